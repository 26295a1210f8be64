# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Shared fixtures: a small camera in the synthetic room, its images, and maps of the images."""
from __future__ import annotations

import os
from pathlib import Path
from typing import Iterator, List, Tuple

import cairn
import numpy as np
import pytest
from numpy.typing import NDArray

Images = Tuple[NDArray[np.float32], NDArray[np.uint8]]

HAS_VIEWER = os.environ.get("CAIRN_HAS_VIEWER", "1") == "1"  # False: built without the viewer
VOXEL = 0.02  # meters
FRAMES = 20


@pytest.fixture(scope="session")
def rig() -> cairn.Rig:
    return cairn.Rig.kinect_v1(320, 240)


@pytest.fixture(scope="session")
def scene() -> cairn.Scene:
    return cairn.Scene("room")


@pytest.fixture(scope="session")
def images(rig: cairn.Rig, scene: cairn.Scene) -> List[Images]:
    """Images of a Kinect along the scene's path, 30 per second."""
    camera = cairn.SceneCamera(scene, rig.depth)
    views = [camera.look(scene.pose(i / 30), i / 30).add_noise(frame=i) for i in range(FRAMES)]
    return [(view.depth.copy(), np.ascontiguousarray(view.color)) for view in views]


def mapped(rig: cairn.Rig, images: List[Images]) -> cairn.Mapper:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    for i, (depth, color) in enumerate(images):
        assert mapper.add(depth, color, time=i / 30).state == "fused"
    return mapper


@pytest.fixture(scope="session")
def mapper(rig: cairn.Rig, images: List[Images]) -> cairn.Mapper:
    """Map shared by tests without changes."""
    return mapped(rig, images)


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory, rig: cairn.Rig) -> Path:
    """Recording on disk with exact truth."""
    folder = tmp_path_factory.mktemp("synth")
    rig.write(folder / "camera.yaml")
    return cairn.synth("room", folder / "recording", frames=FRAMES, camera=folder / "camera.yaml")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Empty working folder."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
