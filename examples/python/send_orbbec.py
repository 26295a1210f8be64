# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Untried on hardware. Sends an Orbbec camera's frames to `cairn live tcp:PORT`, with pyorbbecsdk.

Usage: send_orbbec.py PORT [HOST [TOKEN]]
"""
import sys

import numpy as np
from pyorbbecsdk import Config, OBFormat, OBSensorType, Pipeline
from frame_sender import Sender

pipeline, config = Pipeline(), Config()
profiles = pipeline.get_stream_profile_list(OBSensorType.DEPTH_SENSOR)
config.enable_stream(profiles.get_video_stream_profile(640, 0, OBFormat.Y16, 30))
pipeline.start(config)
lens = pipeline.get_camera_param().depth_intrinsic
camera = {"width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy}
sender = Sender(int(sys.argv[1]), {**camera, "sensor": "structured_light"}, *sys.argv[2:], name="Orbbec")
while True:
    frames = pipeline.wait_for_frames(1000)
    depth = frames.get_depth_frame() if frames else None
    if depth is None:
        continue
    units = np.frombuffer(depth.get_data(), np.uint16) * depth.get_depth_scale()  # millimeters
    print(sender.frame(np.round(units).astype("<u2").tobytes(), time=depth.get_timestamp() / 1000))
