# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Shows a map in a browser while it grows, from numpy arrays. Here, a camera in a synthetic room provides the images.

Usage: live_page.py [--frames N] [--port PORT] [--out FILE.glb]
"""
from __future__ import annotations

import argparse
import time
from pathlib import Path

import cairn


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--frames", type=int, default=300)
    arguments.add_argument("--port", type=int, default=4242, help="0: any free port")
    arguments.add_argument("--out", type=Path, default=Path("live_page.glb"))
    a = arguments.parse_args()

    rig = cairn.Rig.kinect_v1(320, 240)
    room = cairn.Scene("room")
    scene_camera = cairn.SceneCamera(room, rig.depth)  # replace by your camera
    mapper = cairn.Mapper(rig, voxel_size=0.02)
    with cairn.LiveViewer(mapper, port=a.port) as viewer:
        print(f"open {viewer.url}", flush=True)
        for i in range(a.frames):
            images = scene_camera.look(room.pose(i / 30), i / 30).add_noise("kinect", frame=i)
            frame = cairn.Frame(images.depth, images.color, time=i / 30, index=i)
            viewer.update(frame, mapper.add(frame))
            if viewer.commands().finish:  # a button of the page; pause and reset are ignored here
                break
        viewer.finishing()
        mapper.finish_optimization()  # apply all loop closures
        print(mapper.map().export(a.out), viewer.stats())
        while viewer.viewers > 0:  # until the page is closed
            viewer.update()
            time.sleep(0.05)


if __name__ == "__main__":
    main()
