# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Runs pip install . into a virtual environment, with an existing build folder (CAIRN_BUILD)."""
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECK = """
import subprocess, sys, cairn
from pathlib import Path
assert Path(cairn.__file__).is_relative_to(sys.prefix), cairn.__file__
assert cairn.program().is_relative_to(sys.prefix)
report = cairn.reconstruct("synthetic:sphere", "out", frames=3, voxel_size=0.04, texture=False)
assert report.frames.fused == 3
printed = subprocess.run([Path(sys.prefix, "bin", "cairn"), "--version"], check=True, capture_output=True, text=True)
assert cairn.__version__ in printed.stdout
"""


@pytest.mark.skipif("CAIRN_BUILD" not in os.environ, reason="without a build folder")
def test_installs_by_pip(here: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "CAIRN_PROGRAM")}

    def run(*command: str | Path) -> None:
        ran = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stdout + ran.stderr

    run(sys.executable, "-m", "venv", "--system-site-packages", "venv")
    python = Path("venv/bin/python").absolute()
    run(
        python,
        "-m",
        "pip",
        "install",
        "--no-build-isolation",
        "--no-index",
        "--config-settings",
        f"build-dir={os.environ['CAIRN_BUILD']}",
        ROOT,
    )
    run(python, "-c", CHECK)
    run(python, "-m", "pip", "uninstall", "-y", "cairn")
