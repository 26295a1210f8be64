# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Frames in the map of a saved session."""
from __future__ import annotations

from pathlib import Path
from typing import List

import cairn
import numpy as np
import pytest
from conftest import VOXEL, Images


@pytest.fixture
def saved(here: Path, rig: cairn.Rig, images: List[Images]) -> Path:
    session = cairn.Session.create("map/session")
    mapper = session.mapper(rig, voxel_size=VOXEL)
    for i, (depth, color) in enumerate(images):
        assert mapper.add(depth, color, time=i / 30).state == "fused"
    session.checkpoint(mapper)
    assert session.problem() is None
    return here / "map"


def test_localizes_arrays_and_frames(saved: Path, rig: cairn.Rig, images: List[Images]) -> None:
    path = cairn.Map.open(saved).trajectory()
    localizer = cairn.Localizer(saved, rig, changes=True)
    for i in (8, 9):
        found = localizer.add(*images[i], time=i / 30)
        assert found.pose is not None and found.covariance is not None, found.reason
        assert np.linalg.norm(found.pose[:3, 3] - path.poses[i][:3, 3]) < VOXEL
        assert found.guess == ("relocalized" if i == 8 else "motion")
        assert np.linalg.eigvalsh(found.covariance).min() > 0 and found.milliseconds > 0
    localizer.begin_recording()
    again = localizer.add(cairn.Frame(*images[3], time=0.0))
    assert again.pose is not None and again.guess == "relocalized"
    assert localizer.export_changes("change.glb") == []
    assert localizer.rig == rig and localizer.warnings() == [] and "Localizer" in repr(localizer)


def test_refuses_a_folder_without_session(here: Path, rig: cairn.Rig) -> None:
    with pytest.raises(cairn.Error, match="empty folder, not a map with a session"):
        cairn.Localizer(here, rig)
