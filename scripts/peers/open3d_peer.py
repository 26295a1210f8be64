# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Open3D's VoxelBlockGrid (blocks of 8^3): fuses given poses with color, raycasts, and tracks frame to model.

Usage: open3d_peer.py LIST, with lines `depth color tx ty tz qx qy qz qw`; first line: fx fy cx cy depth_scale frames
"""
import json
import resource
import statistics
import sys
import time

import numpy as np
import open3d as o3d

lines = open(sys.argv[1]).read().split("\n")
fx, fy, cx, cy, scale, frames = map(float, lines[0].split())
cpu = o3d.core.Device("CPU:0")
intrinsic = o3d.core.Tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], o3d.core.Dtype.Float64)
grid = o3d.t.geometry.VoxelBlockGrid(
    ("tsdf", "weight", "color"),
    (o3d.core.Dtype.Float32, o3d.core.Dtype.UInt16, o3d.core.Dtype.UInt16),
    ((1), (1), (3)), 0.01, 8, 50000, cpu)
times = {"integrate_ms": [], "raycast_ms": [], "track_ms": []}
previous = None


def matrix(v):
    x, y, z, w = v[3:] / np.linalg.norm(v[3:])
    m = np.eye(4)
    m[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    m[:3, 3] = v[:3]
    return m


def track(live, model):
    """Point-to-plane over three levels. The library's own loop over them needs a filter that Debian's build lacks."""
    levels = [(live, model, intrinsic)]
    for _ in range(2):
        fine = levels[-1]
        half = fine[2].clone() / 2
        half[2, 2] = 1
        levels.append((*(o3d.t.geometry.Image(o3d.core.Tensor(np.ascontiguousarray(image.as_tensor().numpy()[::2, ::2])))
                         for image in fine[:2]), half))
    pose = o3d.core.Tensor(np.eye(4))
    for (a, b, k), iterations in zip(reversed(levels), (10, 5, 3)):
        source, target = a.create_vertex_map(k, float("nan")), b.create_vertex_map(k, float("nan"))
        normals = target.create_normal_map(float("nan"))
        for _ in range(iterations):
            step = o3d.t.pipelines.odometry.compute_odometry_result_point_to_plane(
                source.as_tensor(), target.as_tensor(), normals.as_tensor(), k, pose, 0.07, 0.05)
            pose = step.transformation @ pose
    return pose


for i, line in enumerate(lines[1:int(frames) + 1]):
    words = line.split()
    pose = matrix(np.array(list(map(float, words[2:]))))
    depth = np.asarray(o3d.io.read_image(words[0])).copy()
    depth[depth == 65535] = 0
    depth = o3d.t.geometry.Image(o3d.core.Tensor(depth))
    color = o3d.t.io.read_image(words[1])
    extrinsic = o3d.core.Tensor(np.linalg.inv(pose))
    marks = [time.perf_counter()]
    blocks = grid.compute_unique_block_coordinates(depth, intrinsic, extrinsic, scale, 5.0, 4.0)
    grid.integrate(blocks, depth, color, intrinsic, intrinsic, extrinsic, scale, 5.0, 4.0)
    marks.append(time.perf_counter())
    seen = grid.ray_cast(blocks, intrinsic, extrinsic, 640, 480, ["depth", "color"], scale, 0.3, 5.0, 1.0, 4.0)
    marks.append(time.perf_counter())
    if previous is not None:
        track(depth.clip_transform(scale, 0.3, 5.0, float("nan")), previous)
    marks.append(time.perf_counter())
    previous = o3d.t.geometry.Image(seen["depth"]).clip_transform(scale, 0.3, 5.0, float("nan"))
    if i >= 5:
        for name, a, b in zip(times, marks, marks[1:]):
            times[name].append(1000 * (b - a))

result = {name: round(statistics.median(values), 2) for name, values in times.items()}
result["peak_memory_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
print(json.dumps(result))
