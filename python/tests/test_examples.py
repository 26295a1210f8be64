# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Examples with small inputs."""
from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import List

import pytest
from conftest import HAS_VIEWER

EXAMPLES = Path(__file__).parents[2] / "examples" / "python"
SMALL = {
    "camera_loop.py": ["--frames", "12"],
    "evaluation_table.py": ["--frames", "20", "--voxel-sizes", "0.02", "0.04"],
    "gaussian_splatting.py": ["--frames", "20", "--images", "3", "--voxel-size", "0.04"],
    "live_page.py": ["--frames", "8", "--port", "0"],
    "many_recordings.py": ["--frames", "8", "--voxel-size", "0.04"],
    "other_libraries.py": [],
    "plan_a_path.py": ["--frames", "60"],
}
# Senders to a running program: test_network.py runs the first two, the rest needs cameras.
SENDERS = ["frame_sender.py", "send_recording.py", "send_depthai.py", "send_orbbec.py", "send_realsense.py"]
NEEDS = {"evaluation_table.py": "matplotlib", "plan_a_path.py": "scipy"}


def test_all_examples_are_listed() -> None:
    assert sorted(path.name for path in EXAMPLES.glob("*.py")) == sorted([*SMALL, *SENDERS])


@pytest.mark.parametrize("name", SENDERS)
def test_sender_is_valid_python(name: str) -> None:
    compile((EXAMPLES / name).read_text(), name, "exec")


@pytest.mark.parametrize("name, arguments", SMALL.items())
def test_runs(name: str, arguments: List[str], here: Path) -> None:
    if name in NEEDS and importlib.util.find_spec(NEEDS[name]) is None:
        pytest.skip(f"{NEEDS[name]} is not installed")
    if name == "live_page.py" and not HAS_VIEWER:
        pytest.skip("built without the viewer")
    ran = subprocess.run([sys.executable, EXAMPLES / name, *arguments], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    print(ran.stdout)


def test_notebook_runs(here: Path) -> None:
    for module in ("nbconvert", "ipykernel", "matplotlib"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed")
    shutil.copy(EXAMPLES / "first_map.ipynb", here)  # nbconvert writes beside the notebook
    ran = subprocess.run(
        [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--output", "done", "first_map.ipynb"],
        env={**os.environ, "CAIRN_FRAMES": "20", "IPYTHONDIR": str(here), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "ErrorStatistics" in (here / "done.ipynb").read_text()
