# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Maps in other libraries: Open3D, trimesh and pyopenvdb, as installed. Arrays are passed without files.

Usage: other_libraries.py [MAP]; without MAP a synthetic room
"""
from __future__ import annotations

import importlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cairn
import numpy as np


def map_a_room() -> cairn.Map:
    source = cairn.open("synthetic:room", frames=20)
    mapper = cairn.Mapper(source.rig, voxel_size=0.03)
    for frame in source:
        mapper.add(frame)
    return mapper.map()


def to_open3d(o3d: Any, mesh: cairn.Mesh) -> Any:
    """Copies into legacy arrays: open3d.geometry.TriangleMesh."""
    o3d_mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices.astype(np.float64)),
        o3d.utility.Vector3iVector(mesh.triangles.astype(np.int32)),
    )
    if mesh.normals is not None:
        o3d_mesh.vertex_normals = o3d.utility.Vector3dVector(mesh.normals.astype(np.float64))
    if mesh.colors is not None:
        o3d_mesh.vertex_colors = o3d.utility.Vector3dVector(mesh.colors[:, :3] / 255)
    return o3d_mesh


def from_open3d(o3d_mesh: Any) -> cairn.Mesh:
    return cairn.Mesh(
        np.asarray(o3d_mesh.vertices),
        np.asarray(o3d_mesh.triangles),
        colors=np.round(255 * np.asarray(o3d_mesh.vertex_colors)).astype(np.uint8)
        if o3d_mesh.has_vertex_colors()
        else None,
    )


def with_open3d(o3d: Any, mesh: cairn.Mesh) -> None:
    o3d_mesh = to_open3d(o3d, mesh)
    smoothed = from_open3d(o3d_mesh.filter_smooth_taubin(5))
    print(f"Open3D: {o3d_mesh}; smoothed: {smoothed}")


def with_trimesh(trimesh: Any, mesh: cairn.Mesh) -> None:
    trimesh_mesh = trimesh.Trimesh(mesh.vertices, mesh.triangles, vertex_colors=mesh.colors, process=False)
    print(f"trimesh: {trimesh_mesh}, area {trimesh_mesh.area:.2f} m^2")


def with_openvdb(vdb: Any, map: cairn.Map) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "map.vdb"
        map.export(file)
        grids = [
            vdb.read(str(file), name) for name in ("tsdf", "weight")
        ]  # pyopenvdb does not read integer grids, such as color_weight
    print("OpenVDB:", ", ".join(f"{grid.name} ({grid.activeVoxelCount()} voxels)" for grid in grids))
    # Without a file: copy a dense box into a new grid.
    dense = map.distances().dense()
    grid = vdb.FloatGrid(background=float("inf"))
    grid.copyFromArray(np.nan_to_num(dense.values, nan=float("inf")))
    print(f"OpenVDB: grid with {grid.activeVoxelCount()} distances")


def main() -> None:
    map = cairn.Map.open(sys.argv[1]) if len(sys.argv) > 1 else map_a_room()
    mesh = map.mesh()
    print(f"Cairn: {mesh}")
    uses: dict[str, Callable[[Any], None]] = {
        "open3d": lambda library: with_open3d(library, mesh),
        "trimesh": lambda library: with_trimesh(library, mesh),
        "pyopenvdb": lambda library: with_openvdb(library, map),
    }
    for name, use in uses.items():
        try:
            library = importlib.import_module(name)
        except ImportError:
            print(f"{name} is not installed")
            continue
        use(library)


if __name__ == "__main__":
    main()
