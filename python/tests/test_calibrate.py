# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Calibrations, found or not: no calibration is better than a wrong one."""
from __future__ import annotations

from pathlib import Path
from typing import Any, List

import cairn
import numpy as np
import pytest


def test_correction_offsets_inverse_depth(tmp_path: Path) -> None:
    correction = cairn.DepthCorrection(np.full((2, 3), 0.01))
    assert correction.offsets.shape == (2, 3) and abs(correction.at(0.5, 0.5) - 0.01) < 1e-6
    depth = np.array([[0.0, 2.0], [2.0, 4.0]])
    assert np.allclose(correction.apply(depth), [[0, 1 / 0.51], [1 / 0.51, 1 / 0.26]])
    assert abs(correction.compose(correction).at(0.1, 0.9) - 0.02) < 1e-6
    rig = cairn.Rig(cairn.Camera(320, 240, 262.5, 262.5), depth_correction=correction)
    assert rig.depth_correction == correction and cairn.Rig.kinect_v1().depth_correction is None
    rig.write(tmp_path / "camera.yaml")
    read = cairn.Rig.read(tmp_path / "camera.yaml").depth_correction
    assert read is not None and np.allclose(read.offsets, correction.offsets)


def test_rejects_invalid_corrections() -> None:
    with pytest.raises(ValueError, match=r"offsets is .*; numbers of shape \(rows, columns\) are expected, 1/m"):
        cairn.DepthCorrection([0.1])
    with pytest.raises(cairn.Error):
        cairn.DepthCorrection(np.full((2, 2), 7.0))
    with pytest.raises(ValueError, match="depth is .*; numbers of shape"):
        cairn.DepthCorrection(np.full((2, 2), 0.1)).apply("far")


FIND: List[Any] = [cairn.find_shutter, cairn.find_depth_correction, cairn.find_calibration]


@pytest.mark.parametrize("find", FIND)
def test_gives_reason_without_enough_motion(find: Any, recording: Path) -> None:
    counted: List[int] = []
    found = find(recording, progress=counted.append)
    assert "moved too little" in found.failure_reason and found.failure_reason in repr(found)
    assert found.rig == cairn.open(recording).rig and found.keyframes < 8
    assert counted == list(range(1, 21))
    assert find(lambda: cairn.open(recording)).failure_reason == found.failure_reason  # deterministic


@pytest.mark.parametrize("find", FIND)
def test_rejects_invalid_recordings(find: Any, recording: Path) -> None:
    with pytest.raises(cairn.Error, match="there is no such folder"):
        find(recording / "nowhere")
    with pytest.raises(TypeError, match="recording is a int; a name"):
        find(7)
    with pytest.raises(TypeError, match="a Source of cairn.open is expected"):
        find(lambda: [])

    def stop(frames: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        find(recording, progress=stop)
    with pytest.raises(ZeroDivisionError):
        find(lambda: 1 // 0)
