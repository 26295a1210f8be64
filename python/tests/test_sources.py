# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Recordings: opened, written, played, calibrated."""
from __future__ import annotations

from pathlib import Path
from typing import List

import cairn
import numpy as np
import pytest
from conftest import FRAMES, VOXEL, Images


def test_reads_a_recording(recording: Path, rig: cairn.Rig) -> None:
    source = cairn.open(recording)
    assert "TUM" in source.layout and source.size == FRAMES and source.rig.depth == rig.depth
    frames = list(source)
    assert [f.index for f in frames] == list(range(FRAMES)) and source.read() is None
    first = frames[0]
    assert first.depth is not None and first.depth.shape == (240, 320) and first.depth.dtype == np.float32
    assert first.color is not None and first.color.shape == (240, 320, 3) and first.color.dtype == np.uint8
    assert first.problem is None and first.pose is None and first.acceleration is not None
    assert abs(np.linalg.norm(first.acceleration) - 9.81) < 5


def test_holds_out_every_nth_frame(recording: Path) -> None:
    held_out = [frame.index for frame in cairn.open(recording, frames=slice(2, 12), hold_out=4) if frame.held_out]
    assert held_out == [5, 9]
    with pytest.raises(cairn.Error, match="give 2 or more"):
        cairn.open(recording, hold_out=1)


def test_reads_a_range_of_frames_with_poses(recording: Path) -> None:
    truth = cairn.recorded_truth(recording)
    assert len(truth) == FRAMES
    frames = list(cairn.open(recording, frames=slice(2, 8, 3), poses=truth))
    assert [f.index for f in frames] == [2, 5]
    pose, known = frames[0].pose, truth.at(frames[0].time)
    assert pose is not None and known is not None and np.allclose(pose, known)
    assert len(list(cairn.open(recording, frames=3))) == 3
    with pytest.raises(TypeError, match="frames is a str; a number of frames or slice"):
        cairn.open(recording, frames="0:3")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="count from 0"):
        cairn.open(recording, frames=slice(-3, None))


def test_renders_synthetic_scenes() -> None:
    source = cairn.open("synthetic:sphere", frames=2)
    assert len(list(source)) == 2


def test_plays_a_recording_in_real_time(recording: Path) -> None:
    source = cairn.open(recording, live=True)
    frames = list(source)
    assert 1 <= len(frames) <= FRAMES and frames[-1].index <= FRAMES - 1
    assert source.dropped == FRAMES - len(frames)


def test_recorder_writes_a_readable_recording(here: Path, rig: cairn.Rig, images: List[Images]) -> None:
    recorder = cairn.Recorder("recorded", rig, color_png=True)
    for i, (depth, color) in enumerate(images[:2]):
        recorder.add(np.round(depth * 5000).astype(np.uint16), color, time=i / 30, depth_scale=5000)
    recorder.add(cairn.Frame(*images[2], time=2 / 30))
    assert recorder.bytes > 10000
    frames = list(cairn.open("recorded"))
    assert len(frames) == 3 and frames[2].depth is not None and frames[2].color is not None
    assert np.abs(frames[2].depth - images[2][0]).max() < 1e-4 and np.array_equal(frames[2].color, images[2][1])
    with pytest.raises(cairn.Error):
        cairn.Recorder("recorded", rig)
    with pytest.raises(ValueError, match=r"depth has the shape \(24, 32\)"):
        recorder.add(cairn.Frame(np.ones((24, 32), np.float32), time=1))


def test_writes_other_layouts(here: Path, rig: cairn.Rig, scene: cairn.Scene, images: List[Images]) -> None:
    Path("open3d").mkdir()
    writer = cairn.LayoutWriter("open3d", "open3d", rig)
    for i, (depth, color) in enumerate(images[:3]):
        writer.add(cairn.Frame(depth, color, time=i / 30, index=i, pose=scene.pose(i / 30)))
    with pytest.raises(ValueError, match=r"color has the shape \(24, 32\)"):
        writer.add(cairn.Frame(images[0][0], np.ones((24, 32, 3), np.uint8), time=1, pose=np.eye(4)))
    with pytest.raises(ValueError, match="the frame has no pose"):
        writer.add(cairn.Frame(*images[0], time=1))
    writer.finish()
    assert "open3d" in cairn.layouts()
    assert len(list(cairn.open("open3d"))) == 3


def test_inspects_a_recording(recording: Path) -> None:
    summary = cairn.inspect(cairn.open(recording), 5)
    assert summary.frames == FRAMES and summary.inspected == summary.looked_at == 5 and summary.with_color == 5
    assert 0.3 < summary.nearest < summary.median < summary.farthest < 6 and abs(summary.rate - 30) < 0.1


def test_keeps_a_correct_color_camera(recording: Path) -> None:
    assert cairn.find_color_camera(cairn.open(recording), frames=4) is None


def test_cameras_are_written_read_and_scaled(here: Path) -> None:
    camera = cairn.Camera(640, 480, 500, 510, distortion=[0.1, -0.2])
    assert camera.matrix.tolist() == [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]]
    assert camera.distortion == (0.1, -0.2, 0, 0, 0, 0, 0, 0) and camera.lens == "brown_conrady"
    half = camera.resized(320, 240)
    assert (half.fx, half.fy, half.cx, half.cy) == (250, 255, 159.5, 119.5)
    with pytest.raises(ValueError, match="another aspect ratio"):
        camera.resized(320, 320)
    assert "kinect-v1" in cairn.known_cameras() and cairn.Camera.known("kinect-v1").fx == 525
    with pytest.raises(ValueError, match="known cameras: freiburg1"):
        cairn.Camera.known("nobody")
    color_from_depth = np.eye(4)
    color_from_depth[0, 3] = -0.025
    rig = cairn.Rig(camera, cairn.ColorCamera(half, color_from_depth), sensor="stereo")
    rig.write("camera.yaml")
    again = cairn.Rig.read("camera.yaml")
    assert again == rig and again != cairn.Rig(camera) and again.sensor.name == "stereo"
    assert again.color is not None and np.allclose(again.color.color_from_depth, color_from_depth)
    with pytest.raises(cairn.Error):
        cairn.Rig(camera, sensor="crystal_ball")


def test_options_are_set_and_read(here: Path) -> None:
    options = cairn.Options("time_of_flight", voxel_size=VOXEL)
    assert options.surface.max_depth == pytest.approx(5.5) and options.fuse.truncation == pytest.approx(4 * VOXEL)
    options.map.loops = False
    options.up = "-y"
    options.check()
    Path("options.yaml").write_text("track: {levels: 4}\n")
    options.read("options.yaml")
    assert options.track.levels == 4 and not options.map.loops and options.up == "-y"
    Path("options.yaml").write_text("track: {level: 4}\n")
    with pytest.raises(cairn.Error, match="options.yaml"):
        options.read("options.yaml")


def test_lists_devices() -> None:
    assert [d.index for d in cairn.devices()] == list(range(len(cairn.devices())))
    assert any(d.missing is None for d in cairn.devices())
