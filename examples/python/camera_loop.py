# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Maps images of your own camera, given as arrays. Here, a camera in a synthetic room provides the images.

Usage: camera_loop.py [--frames N] [--out FOLDER]
"""
from __future__ import annotations

import argparse
from pathlib import Path
from typing import Iterator

import cairn
import numpy as np
from numpy.typing import NDArray

Images = tuple[float, NDArray[np.uint16], NDArray[np.uint8]]


def camera(rig: cairn.Rig, frames: int) -> Iterator[Images]:
    """Replace by your camera's loop: seconds, depth in millimeters, color R, G, B."""
    room = cairn.Scene("room")
    scene_camera = cairn.SceneCamera(room, rig.depth)
    for i in range(frames):
        images = scene_camera.look(room.pose(i / 30), i / 30).add_noise("kinect", frame=i)
        yield i / 30, np.round(1000 * images.depth).astype(np.uint16), np.ascontiguousarray(images.color)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--frames", type=int, default=90)
    arguments.add_argument("--out", type=Path, default=Path("out/camera_loop"))
    a = arguments.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)

    rig = cairn.Rig.kinect_v1(320, 240)  # or cairn.Rig(cairn.Camera(width, height, fx, fy, cx, cy))
    mapper = cairn.Mapper(rig, voxel_size=0.02)
    for time, depth, color in camera(rig, a.frames):
        report = mapper.add(depth, color, time=time, depth_scale=1000)
        if report.pose is None:
            print(f"frame {report.index} {report.state}: {report.reason}")
        elif report.covariance is not None and report.index % 10 == 0:
            x, y, z = report.pose[:3, 3]
            sigma = 1000 * np.sqrt(np.diag(report.covariance)[3:].max())
            print(f"frame {report.index}: position {x:.2f} {y:.2f} {z:.2f} m, sigma {sigma:.0f} mm relative to the map")
    mapper.finish()  # apply all loop closures
    mapper.trajectory().write(a.out / "trajectory.txt")
    done = mapper.map().export(a.out / "mesh.glb", texture=True)
    print(f"{len(mapper.trajectory())} frames in the map; {done}")


if __name__ == "__main__":
    main()
