# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Data set for Gaussian splatting or NeRF: rectified images, poses, depth, and points to initialize splats.

Usage: gaussian_splatting.py [RECORDING] [--images N] [--out FOLDER]; without RECORDING a synthetic room
"""
from __future__ import annotations

import argparse
import json
from pathlib import Path

import cairn


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("recording", nargs="?", default="synthetic:room")
    arguments.add_argument("--frames", type=int, default=120)
    arguments.add_argument("--images", type=int, default=100, help="maximum number, the sharpest of their neighbors")
    arguments.add_argument("--voxel-size", type=float, default=0.02)
    arguments.add_argument("--out", type=Path, default=Path("out/splatting"))
    a = arguments.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)

    source = cairn.open(a.recording, frames=a.frames)
    mapper = cairn.Mapper(source.rig, voxel_size=a.voxel_size)
    for frame in source:
        mapper.add(frame)
    mapper.refine()  # refines poses by the agreement of overlapping keyframes
    map = mapper.map()
    for program, folder in (("nerfstudio", a.out / "nerfstudio"), ("colmap", a.out / "colmap")):
        if program == "nerfstudio":
            done = map.export_views(folder, program="nerfstudio", images=a.images)
        else:
            done = map.export_views(folder, program="colmap", images=a.images)
        print(f"{folder}: {done.images} of {done.keyframes} keyframes, {done.points} points")
    cameras = json.loads((a.out / "nerfstudio" / "transforms.json").read_text())
    print(f"images of {cameras['w']}x{cameras['h']} pixels, focal length {cameras['fl_x']:.1f}")
    print(f"next: ns-train splatfacto --data {a.out / 'nerfstudio'}")


if __name__ == "__main__":
    main()
