# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Untried on hardware. Sends a RealSense camera's frames to `cairn live tcp:PORT`, with pyrealsense2.

Usage: send_realsense.py PORT [HOST [TOKEN]]
"""
import sys

import numpy as np
import pyrealsense2 as rs
from frame_sender import Sender

pipeline, config = rs.pipeline(), rs.config()
config.enable_stream(rs.stream.depth, 640, 480, rs.format.z16, 30)
config.enable_stream(rs.stream.color, 640, 480, rs.format.rgb8, 30)
profile = pipeline.start(config)
align = rs.align(rs.stream.depth)  # color in the view of depth
lens = profile.get_stream(rs.stream.depth).as_video_stream_profile().get_intrinsics()
unit = profile.get_device().first_depth_sensor().get_depth_scale()  # meters
camera = {"width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy, "cx": lens.ppx, "cy": lens.ppy}
camera.update(depth_scale=1 / unit, sensor="stereo")
sender = Sender(int(sys.argv[1]), camera, *sys.argv[2:], name="RealSense")
while True:
    frames = align.process(pipeline.wait_for_frames())
    depth, color = frames.get_depth_frame(), frames.get_color_frame()
    if depth and color:
        images = [np.asanyarray(image.get_data()).tobytes() for image in (depth, color)]
        print(sender.frame(*images, time=depth.get_timestamp() / 1000))
