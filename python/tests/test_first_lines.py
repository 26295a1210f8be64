# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""First lines of help(cairn), run verbatim."""
from __future__ import annotations

import math
import re
import resource
import subprocess
import sys
from pathlib import Path

import cairn
import numpy as np
import pytest
from conftest import HAS_VIEWER

ROOT = Path(__file__).parents[2]
assert cairn.__doc__ is not None
LINES = re.sub(r"^    ", "", re.findall(r"(?:^    .*\n)+", cairn.__doc__, re.MULTILINE)[0], flags=re.MULTILINE)


def test_first_lines_run(here: Path, capfd: pytest.CaptureFixture[str]) -> None:
    cairn.Rig.kinect_v1().write("kinect.yaml")
    cairn.synth("room", "recording", frames=5, camera="kinect.yaml")
    names = {"points": np.random.default_rng(1).uniform(-1, 1, (1_000_000, 3)).astype(np.float32)}
    exec(compile(LINES, "help(cairn)", "exec"), names)
    r, m, d, g, known = (names[name] for name in ("r", "m", "d", "g", "known"))
    assert isinstance(r, cairn.FrameReport) and isinstance(m, cairn.Mesh)
    assert r.state == "fused" and r.pose is not None and r.pose.shape == (4, 4)
    assert r.covariance is not None and r.covariance.shape == (6, 6)
    assert m.vertices.dtype == np.float32 and m.vertices.shape[1] == 3 and len(m.triangles) > 10000
    assert m.colors is not None and m.normals is not None
    assert len(m.colors) == len(m.normals) == len(m.vertices)
    assert d.shape == known.shape == (1_000_000,) and g.shape == (1_000_000, 3) and known.any()
    assert Path("room.glb").stat().st_size > 100_000 and Path("out/report.json").exists()
    printed = capfd.readouterr()
    assert "5/5 frames" in printed.err and printed.out == ""  # progress goes to stderr


def test_documentation_runs(here: Path) -> None:
    """Runs every snippet of docs/python.md, in order."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs" / "python.md").read_text(), re.MULTILINE | re.DOTALL)
    assert blocks[0] == LINES and len(blocks) == 7
    cairn.Rig.kinect_v1().write("kinect.yaml")
    cairn.synth("room", "recording", frames=5, camera="kinect.yaml")
    names = {"cairn": cairn}
    for block in blocks[1:]:
        if "LiveViewer" in block and not HAS_VIEWER:
            continue
        exec(compile(block, "docs/python.md", "exec"), names)
    assert Path("run/mesh.glb").exists() and Path("small.glb").exists() and Path("session").is_dir()


def test_readme_runs(here: Path) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    cairn.Rig.kinect_v1().write("kinect.yaml")
    cairn.synth("room", "recording", frames=3, camera="kinect.yaml")
    exec(compile(block, "README.md", "exec"), {"points": np.zeros((5, 3), np.float32)})
    assert Path("room.glb").exists()


def test_import_is_fast_and_without_numpy() -> None:
    def seconds(code: str) -> float:
        # CPU time: on a busy machine the elapsed time varies.
        def used() -> float:
            usage = resource.getrusage(resource.RUSAGE_CHILDREN)
            return usage.ru_utime + usage.ru_stime

        begin = used()
        subprocess.run([sys.executable, "-c", code], check=True)
        return used() - begin

    least: dict[str, float] = {}
    for _ in range(10):  # in turns, as other programs slow down some of them
        for code in ("pass", "import numpy", "import cairn"):
            least[code] = min(seconds(code), least.get(code, math.inf))
    alone, with_numpy, with_cairn = least.values()
    assert with_cairn - alone < 1.5 * (with_numpy - alone)
    subprocess.run([sys.executable, "-c", "import cairn, sys; assert 'numpy' not in sys.modules"], check=True)
