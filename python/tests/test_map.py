# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Outputs: meshes, voxels, distances, files; sessions and graphs."""
from __future__ import annotations

import gc
import threading
from pathlib import Path
from typing import List

import cairn
import numpy as np
import pytest
from conftest import VOXEL, Images, mapped


def test_meshes_are_arrays(mapper: cairn.Mapper, here: Path) -> None:
    mesh = mapper.mesh()
    assert mesh.vertices.dtype == np.float32 and mesh.triangles.dtype == np.uint32
    assert mesh.normals is not None and mesh.colors is not None and mesh.weights is not None
    assert mesh.sigmas is None  # the map was not adjusted
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-3) and mesh.colors[:, 3].min() == 255
    assert mesh.triangles.max() == len(mesh.vertices) - 1 and mesh.texture is None
    vertices = mesh.vertices
    vertices += 1  # the mesh's own memory
    assert not mesh.triangles.flags.writeable
    assert mesh.vertices.base is not None and np.array_equal(mesh.vertices, vertices)
    del mesh
    gc.collect()
    assert np.isfinite(vertices).all()


def test_meshes_are_created_written_and_read(here: Path) -> None:
    corners = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8)
    mesh = cairn.Mesh(corners, [[0, 1, 2]], colors=colors)
    mesh.write("triangle.ply")
    again = cairn.Mesh.read("triangle.ply")
    assert (
        np.array_equal(again.vertices, corners)
        and again.colors is not None
        and np.array_equal(again.colors[:, :3], colors)
    )
    up = np.eye(4)
    up[1, 3] = -1
    assert np.array_equal(mesh.transformed(up).vertices[0], [0, -1, 1])
    assert cairn.evaluate.topology("triangle.ply").border_edges == 3
    with pytest.raises(ValueError, match="triangles refer to vertex 3; the mesh has 3 vertices"):
        cairn.Mesh(corners, [[0, 1, 3]])
    with pytest.raises(TypeError, match="triangles is float64"):
        cairn.Mesh(corners, [[0.0, 1.0, 2.0]])
    with pytest.raises(ValueError, match="normals has 1 rows; 3 are expected"):
        cairn.Mesh(corners, [[0, 1, 2]], normals=[[0, 0, 1]])
    with pytest.raises(cairn.Error, match="triangle.xyz"):
        mesh.write("triangle.xyz")


def test_distances_have_the_shape_of_the_points(mapper: cairn.Mapper) -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (4, 5, 3))
    d, g, known = mapper.distances(points)
    assert d.shape == known.shape == (4, 5) and g.shape == (4, 5, 3)
    assert d.dtype == g.dtype == np.float32 and known.dtype == np.bool_
    assert np.array_equal(np.isnan(d), ~known) and not g[~known].any()
    single = mapper.distances().query(points[1, 2].astype(np.float32))
    assert single[0].shape == () and np.array_equal(single[0], d[1, 2], equal_nan=True)
    assert mapper.distances(np.empty((0, 3)))[0].shape == (0,)
    for wrong, kind in ((np.zeros((3, 2)), ValueError), (np.array(["north"] * 3), TypeError), (None, TypeError)):
        with pytest.raises(kind, match="points is "):
            mapper.distances().query(wrong)  # type: ignore[arg-type]


def test_distances_match_the_scene(scene: cairn.Scene, rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL, poses="given")
    for i, (depth, color) in enumerate(images):
        mapper.add(depth, color, time=i / 30, pose=scene.pose(i / 30))
    mesh = mapper.mesh()
    assert mesh.normals is not None
    points = mesh.vertices + 0.2 * mesh.normals
    d, g, known = mapper.distances(points)
    truth = scene.distance(points)
    assert known.mean() > 0.7 and np.median(np.abs(d - truth)[known]) < 0.02


def test_fields_are_cached_until_the_map_changes(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images[:2])
    before = mapper.distances()
    assert np.shares_memory(before.query([0, 0, 1])[0], before.query([0, 0, 1])[0]) is False
    mapper.add(*images[2], time=2 / 30)
    after = mapper.distances(max_distance=0.5)
    assert before.max_distance == 2 and after.max_distance == 0.5


def test_grids_are_arrays(mapper: cairn.Mapper, here: Path) -> None:
    field = mapper.distances()
    places, samples = field.blocks()
    assert places.shape == (len(samples), 3) and samples.shape[1:] == (16, 16, 16)
    dense = field.dense()
    corner = dense.world_from_voxel[:3, 3]
    assert dense.voxel_size == pytest.approx(2 * VOXEL)
    known = np.argwhere(np.isfinite(dense.values))
    assert len(known) == np.isfinite(samples).sum()
    middle = known[len(known) // 2]
    point = dense.world_from_voxel @ [*middle, 1]
    assert field.query(point[:3])[0] == pytest.approx(dense.values[tuple(middle)], abs=1e-4)
    bounds = field.bounds
    assert bounds is not None and np.isfinite(corner).all()
    low, high = bounds.mean(axis=0) - 0.2, bounds.mean(axis=0) + 0.2
    box = field.dense(low, high)
    assert box.values.shape < dense.values.shape and box.values.size < 30**3
    with pytest.raises(ValueError, match="low must be less than high"):
        field.dense(high, low)
    with pytest.raises(ValueError, match="both corners"):
        field.dense(low)
    field.write("field.vdb")
    assert np.array_equal(cairn.DistanceField.read("field.vdb").dense().values, dense.values, equal_nan=True)


def test_voxels_are_arrays(mapper: cairn.Mapper) -> None:
    voxels = mapper.map().voxels()
    n = len(voxels.places)
    assert voxels.distances.shape == voxels.weights.shape == (n, 8, 8, 8) and voxels.colors.shape == (n, 8, 8, 8, 4)
    seen = voxels.weights > 0
    assert np.abs(voxels.distances[seen]).max() <= voxels.truncation * 1.001
    dense = voxels.dense()
    assert np.isfinite(dense.values).sum() == seen.sum()
    block, x, y, z = np.argwhere(seen)[7]
    point = voxels.world_from_voxel @ [*(8 * voxels.places[block] + [x, y, z]), 1]
    index = np.rint(np.linalg.inv(dense.world_from_voxel) @ point)[:3].astype(int)
    assert dense.values[tuple(index)] == voxels.distances[block, x, y, z]


def test_fields_are_thread_safe(mapper: cairn.Mapper) -> None:
    field = mapper.distances()
    points = np.random.default_rng(1).uniform(-1, 1, (50_000, 3)).astype(np.float32)
    expected, results = field.query(points)[0], []

    def query() -> None:
        results.append(field.query(points)[0])

    threads = [threading.Thread(target=query) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(d, expected, equal_nan=True) for d in results)


def test_exports_all_formats(mapper: cairn.Mapper, here: Path) -> None:
    steps: List[str] = []
    map = mapper.map()
    textured = map.export("room.glb", texture=True, simplify=0.2, progress=lambda done, count, step: steps.append(step))
    assert textured is not None and textured.textures == 1 and steps
    assert [Path(f).name for f in textured.files] == ["room.glb"] and textured.triangles < textured.full_triangles
    plain = map.export("room.ply")
    assert plain is not None and plain.textures == 0 and cairn.Mesh.read("room.ply").colors is not None
    map.export("zup.ply", axes="zup")
    rotated, flat = cairn.Mesh.read("zup.ply"), cairn.Mesh.read("room.ply")
    assert np.array_equal(rotated.vertices, flat.vertices)  # read back into the world
    assert b"axes zup: x right, y forward, z up" in Path("zup.ply").read_bytes()[:200]
    map.export("tileset.json", geo=(48.137, 11.575, 519, 90), texture=False)
    assert b'"transform"' in Path("tileset.json").read_bytes()
    with pytest.raises(ValueError, match="axes is 'up'; world, yup or zup is expected"):
        map.export("x.glb", axes="up")  # type: ignore[arg-type]
    assert map.export("map.vdb", axes="zup") is None and map.export("graph.g2o") is None
    assert len(cairn.PoseGraph.read("graph.g2o").poses) == mapper.statistics().keyframes
    again = cairn.Map.open("map.vdb")
    assert len(again.mesh().triangles) == len(map.mesh().triangles)
    assert np.array_equal(again.voxels().distances, map.voxels().distances)
    views = map.export_views("nerf", images=2)
    assert views.images == min(2, views.keyframes) and Path("nerf/transforms.json").exists()
    with pytest.raises(cairn.Error, match="room.xyz"):
        map.export("room.xyz")
    with pytest.raises(cairn.Error, match="ratio|simplify"):
        map.export("x.glb", simplify=-1)
    with pytest.raises(TypeError, match="export has no option 'color'"):
        map.export("x.glb", color=True)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="compress is 'zip'"):
        map.export("x.glb", compress="zip")  # type: ignore[arg-type]


def test_map_without_color_has_no_texture(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    mapper.add(images[0][0], time=0)
    done = mapper.map().export("gray.glb")
    assert done is not None and done.textures == 0
    with pytest.raises(cairn.Error, match="texture"):
        mapper.map().export("gray.glb", texture=True)


def test_sessions_resume_identically(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    session = cairn.Session.create("session")
    mapper = session.mapper(rig, voxel_size=VOXEL)
    for i in range(4):
        mapper.add(*images[i], time=i / 30)
    session.checkpoint(mapper, "halfway")
    assert session.problem() is None
    with pytest.raises(cairn.Error):
        cairn.Session.resume("session")  # locked by the first session
    del session, mapper
    gc.collect()
    info = cairn.Session.info("session")
    assert info.note == "halfway" and info.rig == rig and info.voxel_size == pytest.approx(VOXEL)
    mapper = cairn.Session.resume("session").mapper()  # keeps its session alive
    gc.collect()
    for i in range(4, 8):
        assert mapper.add(*images[i], time=i / 30).state == "fused"
    uninterrupted = mapped(rig, images[:8])
    assert np.array_equal(mapper.mesh().vertices, uninterrupted.mesh().vertices)


def test_sessions_are_merged(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    for name, part in (("a", images), ("b", images[3:])):
        session = cairn.Session.create(name)
        mapper = session.mapper(rig, voxel_size=VOXEL)
        for i, (depth, color) in enumerate(part):
            mapper.add(depth, color, time=i / 30)
        session.checkpoint(mapper)
        assert session.problem() is None
        del session, mapper
    gc.collect()
    merged = cairn.merge_sessions(["a", "b"], "both")
    assert [m.merged for m in merged] == [True, True] and merged[1].loops > 0
    session = cairn.Session.resume("both")
    mapper = session.mapper()
    assert mapper.recordings == 2
    session.checkpoint(mapper)
    other = cairn.Mapper(rig, voxel_size=VOXEL)
    with pytest.raises(ValueError, match="not created by this session"):
        session.checkpoint(other)


def test_graphs_are_built_and_optimized(here: Path) -> None:
    graph = cairn.PoseGraph()
    step = np.eye(4)
    step[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    step[0, 3] = 1
    pose = np.eye(4)
    for i in range(4):
        noisy = pose.copy()
        noisy[:3, 3] += 0.1 * i
        assert graph.add_node(noisy) == i
        pose = pose @ step
    for i in range(4):
        graph.add_edge(i, (i + 1) % 4, step, 100 * np.eye(6), is_loop=i == 3)
    report = graph.optimize(robust=False)
    assert report.cost < 1e-9 < report.cost_before and report.components == 1 and (report.edge_weights == 1).all()
    assert np.allclose(graph.poses[1], step, atol=1e-6) and graph.chordal_cost() < 1e-9
    graph.write("square.g2o")
    again = cairn.PoseGraph.read("square.g2o")
    assert np.allclose(again.poses, graph.poses) and [e.j for e in again.edges] == [1, 2, 3, 0]
    assert again.edges[3].is_loop and np.allclose(again.edges[0].information, 100 * np.eye(6))
    with pytest.raises(IndexError, match="node 9 does not exist; the graph has 4 nodes"):
        graph.add_edge(0, 9, step)
    graph.add_edge(0, 2, np.eye(4), -np.eye(6))
    with pytest.raises(cairn.Error, match="positive definite"):
        graph.optimize()


def test_trajectories_interpolate_and_reject_invalid_arrays(here: Path) -> None:
    poses = np.stack([np.eye(4)] * 3)
    poses[:, 0, 3] = [0, 1, 2]
    path = cairn.Trajectory([0.0, 0.1, 0.2], poses)
    assert np.array_equal(path.times, [0, 0.1, 0.2]) and np.array_equal(path.poses, poses) and len(path) == 3
    between = path.at(0.05)
    assert between is not None and between[0, 3] == pytest.approx(0.5) and path.at(5) is None
    path.write("path.txt")
    assert np.allclose(cairn.Trajectory.read("path.txt").poses, poses)
    with pytest.raises(ValueError, match="times do not increase"):
        cairn.Trajectory([0.0, 0.0, 0.2], poses)
    with pytest.raises(ValueError, match=r"\(3, 4, 4\) is expected"):
        cairn.Trajectory([0.0, 0.1, 0.2], poses[:2])


def test_splats_are_trained_written_and_read(mapper: cairn.Mapper, here: Path) -> None:
    steps: List[int] = []

    def progress(step: int, _psnr: float, _splats: int) -> bool:
        steps.append(step)
        return step < 3

    splats, report = cairn.train_splats(
        mapper.map(), max_splats=1000, resolution=0.2, hold_out=0, degree=2, progress=progress
    )
    assert report.iterations == steps[-1] == 3
    assert report.images >= 1 and report.held_out is None and report.mesh is None
    assert splats.positions.shape == splats.log_scales.shape == splats.colors.shape == (len(splats), 3)
    assert splats.rotations.shape == (len(splats), 4) and splats.harmonics.shape == (len(splats), 8, 3)
    for name, error in (("x.ply", 0), ("x.spz", 1 / 8192)):
        splats.write(name)
        again = cairn.Splats.read(name)
        np.testing.assert_allclose(again.positions, splats.positions, rtol=0, atol=1.01 * error)
        assert again.degree == splats.degree
    splats.write("x.glb")
    assert Path("x.glb").read_bytes().startswith(b"glTF")
    with pytest.raises(cairn.Error, match="use .ply, .spz or .glb"):
        splats.write("x.stl")
