# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Untried on hardware. Sends an OAK-D camera's frames to `cairn live tcp:PORT`, with depthai 2.

Usage: send_depthai.py PORT [HOST [TOKEN]]
"""
import sys

import depthai as dai
from frame_sender import Sender

pipeline = dai.Pipeline()
left, right = pipeline.create(dai.node.MonoCamera), pipeline.create(dai.node.MonoCamera)
stereo, out = pipeline.create(dai.node.StereoDepth), pipeline.create(dai.node.XLinkOut)
left.setBoardSocket(dai.CameraBoardSocket.CAM_B)
right.setBoardSocket(dai.CameraBoardSocket.CAM_C)
for eye in (left, right):
    eye.setResolution(dai.MonoCameraProperties.SensorResolution.THE_400_P)
left.out.link(stereo.left)
right.out.link(stereo.right)
out.setStreamName("depth")
stereo.depth.link(out.input)  # in the view of the right camera, rectified
with dai.Device(pipeline) as device:
    queue = device.getOutputQueue("depth", maxSize=4, blocking=False)
    matrix = device.readCalibration().getCameraIntrinsics(dai.CameraBoardSocket.CAM_C, 640, 400)
    camera = {"width": 640, "height": 400, "fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2]}
    sender = Sender(int(sys.argv[1]), {**camera, "sensor": "stereo"}, *sys.argv[2:], name="OAK-D")
    while True:
        depth = queue.get()  # millimeters
        print(sender.frame(depth.getFrame().tobytes(), time=depth.getTimestampDevice().total_seconds()))
