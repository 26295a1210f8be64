# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Connection to `cairn live tcp:PORT` or `cairn record tcp:PORT`, for send_recording.py and your camera."""
from __future__ import annotations

import json
import socket
import struct
from typing import Any

Json = dict[str, Any]


class Sender:
    """Connection to cairn. camera: keys of camera.yaml, with width and height."""

    def __init__(self, port: int, camera: Json, host: str = "127.0.0.1", token: str = "", **hello: object) -> None:
        self.socket = socket.create_connection((host, port))
        self.answers = self.socket.makefile()
        self.message({"cairn": 1, "camera": camera, "token": token, **hello})
        self.number = 0

    def message(self, header: Json, data: bytes = b"") -> Json:
        """Sends a message, and returns its answer."""
        text = json.dumps(header, allow_nan=False).encode()
        self.socket.sendall(struct.pack("<II", 4 + len(text) + len(data), len(text)) + text + data)
        answer: Json = json.loads(self.answers.readline() or '{"error": "cairn closed the connection"}')
        if "error" in answer:
            raise ConnectionError(answer["error"])
        return answer

    def frame(self, depth: bytes, color: bytes = b"", formats: tuple[str, str] = ("uint16", "rgb8"), **more: Any) -> Json:
        """Sends images as encoded by `formats`. more: time, pose (tx ty tz qx qy qz qw), gyro, accel."""
        header: Json = {"frame": self.number, "depth": {"format": formats[0], "bytes": len(depth)}, **more}
        if color:
            header["color"] = {"format": formats[1], "bytes": len(color)}
        self.number += 1
        return self.message(header, depth + color)

    def end(self) -> None:
        """Ends the run; closing the connection alone makes cairn wait for the next client."""
        self.message({"end": True})
