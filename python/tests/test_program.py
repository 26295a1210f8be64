# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Runs of the program, their truth, and the evaluation of maps."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cairn
import numpy as np
import pytest
from cairn.runs import _flags
from conftest import FRAMES, VOXEL


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, recording: Path) -> cairn.Report:
    return cairn.reconstruct(recording, tmp_path_factory.mktemp("made") / "out", voxel_size=VOXEL, texture=False)


def test_reconstructs(made: cairn.Report) -> None:
    assert made.frames == cairn.Frames(FRAMES, FRAMES, 0, 0) and made.level in ("good", "weak")
    assert made.mesh.exists() and made.triangles > 1000 and made.json["options"]["voxel_size"] == pytest.approx(VOXEL)
    assert len(cairn.Trajectory.read(made.trajectory)) == FRAMES
    assert len(cairn.Map.open(made.output).mesh().triangles) > 1000


def test_errors_are_the_error_line_of_the_program(made: cairn.Report, recording: Path, here: Path) -> None:
    with pytest.raises(cairn.Error, match="already contains a map"):
        cairn.reconstruct(recording, made.output)
    with pytest.raises(cairn.Error, match="nowhere: there is no such"):
        cairn.reconstruct("nowhere", "out")
    with pytest.raises(cairn.Error, match="voxel-siz"):
        cairn.reconstruct(recording, "out", voxel_siz=0.1)


def test_options_become_flags() -> None:
    given: Any = {
        "voxel_size": 0.02,
        "texture": False,
        "overwrite": True,
        "esdf": False,
        "loops": False,
        "frames": slice(3, None),
        "poses": Path("p.txt"),
        "color_delay": 1,
        "topic": ["a", "b"],
        "camera": None,
        "up": "-y",
    }
    assert _flags(given) == [
        "--voxel-size=0.02",
        "--no-texture",
        "--overwrite",
        "--no-loops",
        "--frames=3:",
        "--poses=p.txt",
        "--color-delay=1",
        "--topic",
        "a",
        "b",
        "--up=-y",
    ]
    assert _flags({"texture": True, "loops": True, "frames": slice(0, 9, 2)}) == ["--texture", "--frames=0:9:2"]


def test_evaluates_a_map_against_the_truth(made: cairn.Report, recording: Path) -> None:
    map = cairn.Map.open(made.output)
    error = cairn.evaluate.map(map, recording, samples=20000)
    assert error.trajectory.ate.rmse < 0.02 and error.trajectory.matched_poses == FRAMES
    assert error.mesh.at[2].f_score > 0.95 and error.mesh.at[2].threshold == 0.05
    assert error.topology.components > 0
    assert "rmse=" in repr(error.trajectory.ate)
    views = cairn.evaluate.views(
        map.mesh(), cairn.open(recording, poses=map.trajectory()), step=4
    )  # in the map's own world
    assert views.frames == FRAMES // 4 and views.psnr > 18


def test_evaluates_distances_and_loops_against_the_scene(recording: Path, scene: cairn.Scene) -> None:
    source = cairn.open(recording, poses=cairn.recorded_truth(recording))
    mapper = cairn.Mapper(source.rig, voxel_size=VOXEL, poses="given")
    for frame in source:
        mapper.add(frame)
    error = cairn.evaluate.distances(mapper.distances(), scene, recording / "groundtruth_seen.ply")
    assert error.distance.median < VOXEL and error.right_signs > 0.9 * error.signs
    loops = cairn.evaluate.loops(mapper, recording)
    assert loops.loops == 0 and loops.right == 0


def test_merges_maps(made: cairn.Report, recording: Path, here: Path) -> None:
    other = cairn.reconstruct(recording, "other", voxel_size=VOXEL, texture=False, frames=slice(3, None))
    both = cairn.merge([made.output, other.output], "both", texture=False)
    assert cairn.Map.open(both).recordings == 2


def test_synthetic_truth_is_exact(recording: Path, scene: cairn.Scene) -> None:
    truth = cairn.recorded_truth(recording)
    assert np.allclose(truth.poses[3], scene.pose(truth.times[3]), atol=1e-6)
    surface = cairn.Mesh.read(recording / "groundtruth_mesh.ply")
    assert np.abs(scene.distance(surface.vertices[np.unique(surface.triangles)])).max() < 1e-4
    seen = cairn.SceneCamera(scene).look(scene.pose(0))
    center = np.append((seen.depth[240, 320] * np.array([0.5 / 525, 0.5 / 525, 1])), 1)
    assert abs(scene.distance((scene.pose(0) @ center)[:3])) < 1e-3
    assert seen.confidence is None and seen.add_noise("lidar").confidence is not None
    assert np.array_equal(seen.add_noise(seed=3).depth, seen.add_noise(seed=3).depth)


def test_interrupted_run_writes_the_map(here: Path) -> None:
    script = "import cairn; cairn.reconstruct('synthetic:room', 'out', frames=2000, voxel_size=0.02, texture=False)"
    child = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list(Path("out/session").rglob("*.depth.png"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(child.pid, signal.SIGINT)  # as a terminal does: the program has its own process group
    messages = child.communicate(timeout=120)[1]
    assert "KeyboardInterrupt" in messages and child.returncode != 0
    assert Path("out/mesh.glb").exists() and Path("out/report.json").exists()
