# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Frames over a network, from the example sender."""
from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import List

import cairn
import numpy as np
from conftest import Images

SENDER = Path(__file__).parents[2] / "examples" / "python" / "send_recording.py"


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


def test_sent_frames_equal_the_recording(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    recorder = cairn.Recorder(here / "recording", rig)
    for i, (depth, color) in enumerate(images[:5]):
        recorder.add(depth, color, time=i / 30)
    port = free_port()
    printed: List[str] = []

    def send() -> None:
        for _ in range(20):  # until the port is open
            time.sleep(0.2)
            ran = subprocess.run([sys.executable, SENDER, str(port), "recording"], capture_output=True, text=True)
            printed.append(ran.stdout + ran.stderr)
            if ran.returncode == 0:
                return

    sending = threading.Thread(target=send)
    sending.start()
    sent = [frame for frame in cairn.open(f"tcp:{port}") if frame.problem is None]
    sending.join()
    assert printed[-1].count("'state': 'received'") == 5, printed
    stored = list(cairn.open(here / "recording"))
    assert [frame.time for frame in sent] == [frame.time for frame in stored]
    for a, b in zip(sent, stored):
        assert a.depth is not None and b.depth is not None and np.array_equal(a.depth, b.depth)
        assert a.color is not None and b.color is not None and np.array_equal(a.color, b.color)
