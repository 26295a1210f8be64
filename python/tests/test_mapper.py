# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Mapping of frames, messages for invalid input, and use by several threads."""
from __future__ import annotations

import gc
import threading
from pathlib import Path
from typing import Any, Iterator, List

import cairn
import numpy as np
import pytest
from conftest import VOXEL, Images, mapped


def test_tracks_arrays(mapper: cairn.Mapper, scene: cairn.Scene, images: List[Images]) -> None:
    path = mapper.trajectory()
    assert len(path) == len(images)
    truth = cairn.Trajectory(np.arange(len(images)) / 30, np.stack([scene.pose(i / 30) for i in range(len(images))]))
    assert cairn.evaluate.trajectory(path, truth).ate.rmse < 0.02


def test_reports_pose_and_covariance(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    first, second = (mapper.add(*images[i], time=i / 30) for i in range(2))
    assert first.pose is not None and second.pose is not None and second.covariance is not None
    assert np.allclose(first.pose, np.eye(4)) and first.covariance is None  # no map to align with
    assert np.allclose(second.covariance, second.covariance.T) and np.linalg.eigvalsh(second.covariance).min() > 0
    assert second.reason == "" and second.fit.inlier_share > 0.3 and "track" in second.stage_ms
    moved = np.linalg.inv(mapper.upright().world_from_tracked) @ mapper.trajectory().poses[1]
    assert np.allclose(moved, second.pose, atol=1e-6)


def test_lost_frame_has_no_pose(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    mapper.add(*images[0], time=0)
    report = mapper.add(np.zeros((240, 320), np.float32), time=1)
    assert report.state in ("lost", "skipped") and report.pose is None and report.covariance is None and report.reason


def test_frames_and_arrays_give_the_same_map(rig: cairn.Rig, images: List[Images]) -> None:
    one, other = cairn.Mapper(rig, voxel_size=VOXEL), cairn.Mapper(rig, voxel_size=VOXEL)
    for i, (depth, color) in enumerate(images[:3]):
        one.add(depth, color, time=i / 30)
        rgba = np.dstack([color, np.full((240, 320), 255, np.uint8)])
        frame = cairn.Frame(depth.astype(np.float64), rgba, time=i / 30, index=i)
        assert frame.depth is not None and frame.color is not None
        assert np.array_equal(frame.depth, depth) and np.array_equal(frame.color, color)
        other.add(frame)
    assert np.array_equal(one.mesh().vertices, other.mesh().vertices)


def test_accepts_depth_in_units(rig: cairn.Rig, images: List[Images]) -> None:
    depth, color = images[0]
    units = np.round(depth * 1000).astype(np.uint16)
    frame = cairn.Frame(units, time=0, depth_scale=1000)
    assert frame.depth is not None and np.allclose(frame.depth, units / 1000)
    assert frame.color is None
    assert cairn.Mapper(rig).add(units, color, time=0, depth_scale=1000).state == "fused"


def test_accepts_arrays_that_are_not_contiguous(images: List[Images]) -> None:
    depth, color = images[0]
    frame = cairn.Frame(np.asfortranarray(depth), color[:, ::-1, ::-1], time=0)
    assert frame.depth is not None and frame.color is not None
    assert np.array_equal(frame.depth, depth) and np.array_equal(frame.color, color[:, ::-1, ::-1])


DEPTH = np.ones((240, 320), np.float32)
WRONG: List[Any] = [
    ({"depth": [[1.0]]}, TypeError, "depth is a list; an array of shape"),
    ({"depth": DEPTH[None]}, ValueError, r"depth is float32 of shape \(1, 240, 320\); an array of shape"),
    ({"depth": DEPTH.astype(complex)}, TypeError, "depth is complex128"),
    ({"depth": DEPTH[:, :100]}, ValueError, r"depth has the shape \(240, 100\); the rig's camera has \(240, 320\)"),
    ({"depth": DEPTH.astype(np.uint16)}, ValueError, "give depth_scale, its units per meter"),
    ({"depth": DEPTH * np.nan}, ValueError, "depth has 76800 negative or non-finite values"),
    ({"depth": -DEPTH}, ValueError, "depth has 76800 negative or non-finite values"),
    ({"depth": DEPTH * np.inf}, ValueError, "depth has 76800 negative or non-finite values"),
    ({"depth": DEPTH, "depth_scale": 0}, ValueError, "depth_scale is 0; units per meter are expected"),
    ({"depth": DEPTH, "color": DEPTH}, TypeError, "color is float32"),
    ({"depth": DEPTH, "color": np.zeros((240, 320), np.uint8)}, ValueError, r"color is uint8 of shape \(240, 320\)"),
    ({"depth": DEPTH, "color": np.zeros((24, 32, 3), np.uint8)}, ValueError, r"color has the shape \(24, 32\)"),
    ({"depth": DEPTH, "confidence": DEPTH}, ValueError, "confidence is float32"),
    ({"depth": DEPTH, "time": None}, TypeError, "time is missing: seconds"),
    ({"depth": DEPTH, "time": float("nan")}, ValueError, "time is nan"),
    ({"depth": DEPTH, "guess": np.eye(3)}, ValueError, r"guess is float64 of shape \(3, 3\); a pose of shape \(4, 4\)"),
    ({"depth": DEPTH, "pose": 2 * np.eye(4)}, ValueError, "pose is not a rigid transform: a rotation, a translation"),
    ({"depth": DEPTH, "pose": "north"}, TypeError, "pose is "),
    ({"depth": DEPTH, "gyro": np.zeros(4)}, ValueError, r"gyro is float64 of shape \(4,\); \(N, 4\) is expected"),
    ({"depth": DEPTH, "accelerations": [1, 2]}, ValueError, r"accelerations is a list; \(N, 4\) is expected"),
    ({"depth": DEPTH, "acceleration": [1, 2]}, ValueError, "a vector of three numbers is expected"),
]


@pytest.mark.parametrize("given, kind, text", WRONG)
def test_errors_state_given_and_expected_value(rig: cairn.Rig, given: Any, kind: Any, text: str) -> None:
    with pytest.raises(kind, match=text):
        add: Any = cairn.Mapper(rig).add
        add(**{"time": 0, **given})


def test_errors_have_the_texts_of_the_library(rig: cairn.Rig, tmp_path: Path) -> None:
    with pytest.raises(cairn.Error, match="there is no such folder"):
        cairn.open(tmp_path / "nowhere")
    with pytest.raises(cairn.Error, match="voxel_size"):
        cairn.Mapper(rig, voxel_size=-1)
    with pytest.raises(cairn.Error, match="width"):
        cairn.Camera(1, 1, 1, 1)
    with pytest.raises(ValueError, match="poses is 'wrong'"):
        cairn.Mapper(rig, poses="wrong")  # type: ignore[arg-type]
    assert issubclass(cairn.Error, RuntimeError)


def test_uses_given_poses(rig: cairn.Rig, scene: cairn.Scene, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL, poses="given")
    for i, (depth, color) in enumerate(images[:3]):
        report = mapper.add(depth, color, time=i / 30, pose=scene.pose(i / 30))
        assert report.pose is not None and np.allclose(report.pose, scene.pose(i / 30)) and report.covariance is None
    assert mapper.add(images[3][0], time=1).state == "skipped"
    error = np.abs(scene.distance(mapper.mesh().vertices))
    assert np.median(error) < 0.01


def test_results_outlive_the_mapper(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images[:3])
    map, vertices, field = mapper.map(), mapper.mesh().vertices, mapper.distances()
    times, depth = mapper.trajectory().times, cairn.Frame(images[0][0], time=0).depth
    before = vertices.copy()
    del mapper
    gc.collect()
    assert np.array_equal(map.mesh().vertices, before) and np.array_equal(vertices, before)
    assert field.query([0, 0, 1])[0].shape == () and len(times) == 3
    assert depth is not None and np.array_equal(depth, images[0][0])


def test_threads_share_a_mapper(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    errors: List[BaseException] = []

    def add(number: int) -> None:
        try:
            for i, (depth, color) in enumerate(images):
                mapper.add(depth, color, time=i / 30 + number * 1e-3)
        except BaseException as error:
            errors.append(error)

    def read() -> None:
        try:
            for _ in range(10):
                mapper.mesh(), mapper.trajectory(), mapper.distances(np.zeros((100, 3)))
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=work) for work in (lambda: add(0), lambda: add(1), read)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors and len(mapper.trajectory()) >= len(images) // 2


def test_long_calls_release_the_interpreter(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    counted, done = [0], threading.Event()

    def count() -> None:
        while not done.is_set():
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    mapper.add(*images[0], time=0)
    mapper.map().mesh()
    done.set()
    thread.join()
    assert counted[0] > 1000


def test_callback_cannot_use_the_calling_object(mapper: cairn.Mapper, here: Path) -> None:
    def use(done: int, count: int, step: str) -> None:
        mapper.mesh()

    with pytest.raises(cairn.Error, match="a callback cannot use the object that called it"):
        mapper.map().export("x.glb", progress=use)
    assert not Path("x.glb").exists()


def test_exception_in_a_callback_ends_the_call(mapper: cairn.Mapper, here: Path) -> None:
    def stop(done: int, count: int, step: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mapper.map().export("x.glb", progress=stop)
    assert not Path("x.glb").exists() and len(mapper.mesh().triangles) > 0


def test_refines_and_reintegrates(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images)
    assert mapper.refine().keyframes == mapper.statistics().keyframes
    before = len(mapper.mesh().triangles)
    mapper.reintegrate(cairn.Frame(d, c, time=i / 30) for i, (d, c) in enumerate(images))
    assert not mapper.warnings() and abs(len(mapper.mesh().triangles) / before - 1) < 0.25


def test_adjusts_and_reintegrates_with_corrected_depth(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images)
    mapper.refine()
    fractions: List[float] = []
    adjusted = mapper.adjust(progress=fractions.append)
    assert adjusted.keyframes == mapper.statistics().keyframes and adjusted.observations > adjusted.surfels > 0
    assert all(covariance.shape == (6, 6) for _, covariance in adjusted.covariances)
    assert len(adjusted.covariances) == adjusted.keyframes
    assert fractions == sorted(fractions) and len(fractions) > 1 and not mapper.warnings()
    frames: List[int] = []
    correction = cairn.DepthCorrection(np.full((3, 4), 0.001))
    mapper.reintegrate(
        (cairn.Frame(d, c, time=i / 30) for i, (d, c) in enumerate(images)), correction, progress=frames.append
    )
    assert frames == list(range(1, len(images) + 1)) and mapper.rig.depth_correction == correction
    assert not mapper.warnings()


def test_finishes_in_one_call(rig: cairn.Rig, images: List[Images]) -> None:
    def again() -> Iterator[cairn.Frame]:
        return (cairn.Frame(d, c, time=i / 30) for i, (d, c) in enumerate(images))

    mapper, other = mapped(rig, images), mapped(rig, images)
    stages: List[str] = []
    report = mapper.finish(refine=True, reintegrate=again(), progress=lambda stage, fraction: stages.append(stage))
    assert report.refined is not None and report.adjusted is not None and report.is_reintegrated
    assert list(dict.fromkeys(stages))[-1] == "reintegrate" and not mapper.warnings()
    other.refine()
    other.reintegrate(again(), other.adjust().correction)
    other.freeze_gravity()
    assert np.array_equal(mapper.mesh().vertices, other.mesh().vertices)
    report = mapper.finish(refine=True, adjust=True, progress=lambda stage, fraction: False)
    assert report.refined is not None and not report.is_reintegrated


def test_finish_raises_exceptions_of_its_callback(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images)

    def stop(stage: str, fraction: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mapper.finish(adjust=True, progress=stop)
    with pytest.raises(TypeError, match="a Frame is expected, not a int"):
        mapper.finish(reintegrate=[1, 2])  # type: ignore[list-item]


def test_adjustment_can_be_canceled(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images)
    assert mapper.adjust(progress=lambda fraction: False).keyframes == 0  # before the first keyframe

    def stop(fraction: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mapper.adjust(progress=stop)
    with pytest.raises(cairn.Error, match="a callback cannot use the object that called it"):
        mapper.adjust(progress=lambda fraction: bool(mapper.mesh()))
    before = mapper.mesh().vertices
    with pytest.raises(KeyboardInterrupt):
        mapper.reintegrate((cairn.Frame(*images[0], time=0) for _ in range(3)), progress=stop)
    assert np.array_equal(mapper.mesh().vertices, before)
    mapper.reintegrate((cairn.Frame(*images[0], time=0) for _ in range(3)), progress=lambda frames: False)
    assert mapper.refine(progress=lambda fraction: False).pairs_aligned == 0
    assert np.array_equal(mapper.mesh().vertices, before)
    assert any("interrupted" in warning for warning in mapper.warnings())


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 0.21])
def test_rejects_options_out_of_range_by_name(rig: cairn.Rig, value: float) -> None:
    options = cairn.Options()
    options.fuse.voxel_size = value
    with pytest.raises(cairn.Error, match="fuse.voxel_size"):
        options.check()
    with pytest.raises(cairn.Error, match="fuse.voxel_size"):
        cairn.Mapper(rig, options)
    options.fuse.voxel_size, options.fuse.truncation = 0.2, 0.8  # as documented
    options.check()


def test_held_out_frames_get_a_pose_only(rig: cairn.Rig, images: List[Images]) -> None:
    mapper, without = cairn.Mapper(rig, voxel_size=VOXEL), cairn.Mapper(rig, voxel_size=VOXEL)
    for i, (depth, color) in enumerate(images[:6]):
        report = mapper.add(depth, color, time=i / 30, held_out=i == 3)
        assert report.state == ("held_out" if i == 3 else "fused") and report.pose is not None
        if i != 3:
            without.add(depth, color, time=i / 30)
    assert len(mapper.trajectory()) == 6 and np.array_equal(mapper.mesh().vertices, without.mesh().vertices)
    frame = cairn.Frame(*images[0], time=0, held_out=True)
    assert frame.held_out
    frame.held_out = False
    assert not frame.held_out


def test_exceptions_of_the_frames_are_raised(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images[:3])
    before = mapper.mesh().vertices

    def interrupted_frames() -> Iterator[cairn.Frame]:
        yield cairn.Frame(*images[0], time=0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mapper.reintegrate(interrupted_frames())
    with pytest.raises(TypeError, match="a Frame is expected, not a int"):
        mapper.reintegrate([1, 2])  # type: ignore[list-item]
    assert np.array_equal(mapper.mesh().vertices, before)  # the map stays unchanged


def test_live_distances_follow_each_frame(rig: cairn.Rig, images: List[Images]) -> None:
    options = cairn.Options(rig.sensor, voxel_size=VOXEL)
    options.distances.live = True
    mapper = cairn.Mapper(rig, options)
    assert mapper.live_distances() is None
    for i, (depth, color) in enumerate(images[:3]):
        report = mapper.add(depth, color, time=i / 30)
    field = mapper.live_distances()
    assert field is not None and report.pose is not None
    assert field.query(report.pose[:3, 3])[2]
