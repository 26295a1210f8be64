# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Sends a recording in the TUM layout, with a camera.yaml, to `cairn live tcp:PORT` or `cairn record tcp:PORT`.

Usage: send_recording.py PORT FOLDER [--host HOST] [--token TOKEN] [--frames N]
"""
from __future__ import annotations

import argparse
import json
from pathlib import Path

from frame_sender import Json, Sender


def stamped_files(file: Path) -> list[tuple[float, Path]]:
    """Lines `timestamp path` of depth.txt and rgb.txt."""
    lines = [line.split() for line in file.read_text().splitlines() if line and line[0] != "#"]
    return [(float(time), file.parent / name) for time, name in lines]


def send_recording(sender: Sender, folder: Path, frames: int | None) -> None:
    colors = stamped_files(folder / "rgb.txt") if (folder / "rgb.txt").exists() else []
    for time, depth in stamped_files(folder / "depth.txt")[:frames]:
        near = min(colors, key=lambda stamped: abs(stamped[0] - time), default=(0.0, depth))
        color = near[1] if colors and abs(near[0] - time) < 0.02 else None
        form = "png" if color and color.suffix == ".png" else "jpeg"
        answer = sender.frame(depth.read_bytes(), color.read_bytes() if color else b"", ("png", form), time=time)
        print(answer)


def camera_of(file: Path) -> Json:
    """Depth camera of a camera.yaml: its lines `key: value`, without sections."""
    lines = [line.split("#")[0].split(":") for line in file.read_text().splitlines() if ":" in line and line[0] != " "]
    values = {key: value.strip() for key, value in lines if value.strip()}
    return {key: value if value[0].isalpha() else json.loads(value) for key, value in values.items()}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("port", type=int)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--host", default="127.0.0.1")
    arguments.add_argument("--token", default="")
    arguments.add_argument("--frames", type=int)
    a = arguments.parse_args()
    sender = Sender(a.port, camera_of(a.folder / "camera.yaml"), a.host, a.token)
    send_recording(sender, a.folder, a.frames)
    sender.end()


if __name__ == "__main__":
    main()
