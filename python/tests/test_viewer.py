# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Pages in a browser, and the incremental surface."""
from __future__ import annotations

import gc
import json
import socket
import struct
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any, Iterator, List, Tuple

import cairn
import numpy as np
import pytest
from conftest import HAS_VIEWER, VOXEL, Images, mapped

pytestmark = pytest.mark.skipif(not HAS_VIEWER, reason="built without the viewer")

CELL = 4 * 8 * VOXEL  # meters, side of a surface block
SURFACE = 1  # first word of a message with a surface block
TEXT, BINARY = 1, 2  # opcodes of WebSocket messages
TIMEOUT = 20  # seconds


def fetch(url: str) -> bytes:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(url, timeout=TIMEOUT) as response:
        data: bytes = response.read()
        return data


class Page:
    """WebSocket of the live page (RFC 6455)."""

    def __init__(self, url: str) -> None:
        address = urllib.parse.urlsplit(url)
        self.socket = socket.create_connection((address.hostname, address.port or 0), TIMEOUT)
        self.stream = self.socket.makefile("rb")
        lines = [
            f"GET {address.path}live HTTP/1.1",
            f"Host: {address.netloc}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version: 13",
        ]
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        assert b"101" in self.stream.readline()
        while self.stream.readline().strip():
            pass

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *args: object) -> None:
        self.stream.close()
        self.socket.close()

    def messages(self) -> Iterator[Tuple[int, bytes]]:
        """Opcode and payload of each message."""
        while True:
            first, second = self.stream.read(2)
            size = second & 127
            if size >= 126:
                size = int.from_bytes(self.stream.read(2 if size == 126 else 8), "big")
            yield first & 15, self.stream.read(size)

    def send(self, text: str) -> None:
        """Sends less than 126 bytes, masked with zeros."""
        self.socket.sendall(bytes([128 | TEXT, 128 | len(text), 0, 0, 0, 0]) + text.encode())


def update(viewer: cairn.LiveViewer, mapper: cairn.Mapper, images: List[Images], begin: int = 0) -> None:
    for i, (depth, color) in enumerate(images, begin):
        frame = cairn.Frame(depth, color, time=i / 30, index=i)
        viewer.update(frame, mapper.add(frame))


def test_live_viewer_serves_the_page_and_the_map(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    with cairn.LiveViewer(mapper, port=0) as viewer:
        assert viewer.url.startswith("http://127.0.0.1:") and viewer.urls == [viewer.url] and viewer.fingerprint == ""
        assert not viewer.is_opened and viewer.viewers == 0 and viewer.url in repr(viewer)
        assert b"<html" in fetch(viewer.url)[:10_000] and viewer.is_opened
        assert json.loads(fetch(viewer.url + "data.json")) == {"mode": "live"}
        with pytest.raises(urllib.error.HTTPError):
            fetch(viewer.url + "nothing")
        update(viewer, mapper, images[:3])
        assert viewer.stats().parts > 0 and viewer.stats().first_mesh_seconds is not None
        with Page(viewer.url) as page:
            texts: List[Any] = []
            for opcode, payload in page.messages():
                if opcode == TEXT:
                    texts.append(json.loads(payload))
                elif opcode == BINARY and struct.unpack_from("<I", payload)[0] == SURFACE:
                    vertices, indices = struct.unpack_from("<II", payload, 40)
                    assert indices % 3 == 0 and len(payload) == 48 + 16 * vertices + 2 * indices
                    if vertices > 0:
                        break
            assert texts[0]["status"] == "waiting"
    with pytest.raises(urllib.error.URLError):
        fetch(viewer.url)


def test_live_viewer_receives_commands(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    with cairn.LiveViewer(mapper, port=0) as viewer, Page(viewer.url) as page:
        commands = viewer.commands()
        assert commands.pause is None and not commands.reset and not commands.finish
        page.send('{"do": "pause"}')
        deadline = time.monotonic() + TIMEOUT
        while (commands := viewer.commands()).pause is None and time.monotonic() < deadline:
            viewer.update(paused=True)
            time.sleep(0.01)
        assert commands.pause is True and viewer.viewers == 1


def test_live_viewer_starts_another_map(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    with cairn.LiveViewer(mapper, port=0) as viewer:
        update(viewer, mapper, images[:2])
        mapper = cairn.Mapper(rig, voxel_size=VOXEL)
        viewer.begin(mapper, frames_before=2)
        gc.collect()  # the viewer does not use the first mapper
        update(viewer, mapper, images[:2])
        viewer.begin(mapper)
        update(viewer, mapper, images[2:4], begin=2)
        viewer.finishing()
        assert viewer.stats().parts > 0


def test_live_viewer_rejects_invalid_use(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    viewer = cairn.LiveViewer(mapper, port=0)
    frame = cairn.Frame(*images[0], time=0)
    report = mapper.add(frame)
    with pytest.raises(TypeError, match="a frame with its report, or neither"):
        viewer.update(frame)
    with pytest.raises(ValueError, match=r"depth has the shape \(24, 32\)"):
        viewer.update(cairn.Frame(np.ones((24, 32), np.float32), time=1), report)
    with pytest.raises(ValueError, match="port is 70000"):
        cairn.LiveViewer(mapper, port=70000)
    with pytest.raises(cairn.Error, match="port"):
        cairn.LiveViewer(mapper, port=urllib.parse.urlsplit(viewer.url).port or 0)
    with pytest.raises(cairn.Error):
        viewer.finished(here)  # no map
    with pytest.raises(TypeError):
        cairn.LiveViewer(None)  # type: ignore[arg-type]

    def use(done: int, count: int, step: str) -> None:
        viewer.update()

    with pytest.raises(cairn.Error, match="a callback cannot use the object that called it"):
        mapper.map().export("x.glb", progress=use)
    viewer.close()
    viewer.close()
    with pytest.raises(ValueError, match="closed"):
        viewer.update()


def test_viewers_may_end_in_a_callback(rig: cairn.Rig, images: List[Images], here: Path) -> None:
    mapper = mapped(rig, images[:2])
    live: List[object] = [cairn.LiveViewer(mapper, port=0), cairn.LiveSurface(mapper)]
    mapper.map().export("x.glb", progress=lambda done, count, step: live.clear())
    assert not live and mapper.add(*images[2], time=2 / 30).state == "fused"


def test_threads_share_a_live_viewer(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    errors: List[BaseException] = []
    with cairn.LiveViewer(mapper, port=0) as viewer:

        def poll() -> None:
            try:
                for _ in range(50):
                    viewer.update()
                    viewer.commands(), mapper.trajectory()
            except BaseException as error:
                errors.append(error)

        thread = threading.Thread(target=poll)
        thread.start()
        update(viewer, mapper, images[:5])
        thread.join()
    assert not errors and len(mapper.trajectory()) == 5


def test_map_viewer_serves_a_file(mapper: cairn.Mapper, here: Path) -> None:
    mapper.map().export("room.ply")
    with cairn.MapViewer("room.ply", port=0) as viewer:
        assert not viewer.is_opened
        assert b"<html" in fetch(viewer.url)[:10_000] and viewer.is_opened
        data = json.loads(fetch(viewer.url + "data.json"))
        assert data["mode"] == "finished" and fetch(viewer.url + data["mesh"])[:4] == b"glTF"
        with pytest.raises(cairn.Error, match="port"):
            cairn.MapViewer("room.ply", port=urllib.parse.urlsplit(viewer.url).port or 0)
    with pytest.raises(urllib.error.URLError):
        fetch(viewer.url)
    with pytest.raises(ValueError, match="closed"):
        viewer.is_opened
    with pytest.raises(cairn.Error, match="nowhere"):
        cairn.MapViewer("nowhere", port=0)


def test_live_surface_gives_blocks_as_arrays(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = mapped(rig, images[:2])
    changes = cairn.LiveSurface(mapper).changes(max_bricks=100_000)
    assert changes.world_from_submap.shape == (1, 4, 4) and changes.world_from_submap.dtype == np.float64
    assert np.array_equal(changes.world_from_submap[:, 3], [[0, 0, 0, 1]])
    blocks = changes.blocks
    assert sum(len(block.triangles) for block in blocks) > 10_000
    assert len({(block.submap, block.cell) for block in blocks}) == len(blocks)
    for block in blocks:
        n = len(block.vertices)
        assert block.vertices.shape == block.normals.shape == (n, 3) and block.colors.shape == (n, 4)
        assert block.vertices.dtype == block.normals.dtype == np.float32
        assert block.colors.dtype == np.uint8 and block.triangles.dtype == np.uint32
        assert block.submap == 0 and block.triangles.shape[1:] == (3,)
        if n == 0:
            assert len(block.triangles) == 0
            continue
        assert block.triangles.max() == n - 1
        assert np.allclose(np.linalg.norm(block.normals, axis=1), 1, atol=1e-3)
        centroids = block.vertices[block.triangles].mean(axis=1) / CELL - block.cell
        assert centroids.min() > -1e-3 and centroids.max() < 1 + 1e-3
    full = max(blocks, key=lambda block: len(block.vertices))
    vertices = full.vertices
    before = vertices.copy()
    del changes, blocks, block, full
    gc.collect()
    assert np.array_equal(vertices, before)  # the array keeps its memory alive


def test_live_surface_gives_changes_only(rig: cairn.Rig, images: List[Images]) -> None:
    mapper = cairn.Mapper(rig, voxel_size=VOXEL)
    surface = cairn.LiveSurface(mapper)
    empty = surface.changes()
    assert empty.blocks == [] and empty.coverage is None and empty.world_from_submap.shape == (1, 4, 4)
    mapper.add(*images[0], time=0)
    assert len(surface.changes(max_bricks=100_000).blocks) > 0
    assert surface.changes(max_bricks=100_000, all=True).blocks == []
    mapper.add(*images[1], time=1 / 30)
    few = surface.changes(max_bricks=64, all=True)
    assert 0 < len(few.blocks) < len(surface.changes(max_bricks=100_000, all=True).blocks)
    assert few.coverage is not None and 0 < few.coverage <= 1
    with pytest.raises(TypeError):
        cairn.LiveSurface(None)  # type: ignore[arg-type]
    del mapper
    gc.collect()
    assert surface.changes().blocks == []  # keeps the mapper alive
