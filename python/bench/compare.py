# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Ratio of Python's speed to the library's speed: both do the same work alternately, each in its own process.

Usage: PYTHONPATH=build/release/python python3 python/bench/compare.py RECORDING [FRAMES [ROUNDS]]
Requires build/release/python/cairn_python_peer (ninja -C build/release cairn_python_peer).
"""
from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cairn
import numpy as np

PEER = Path(cairn.__file__).parent.parent / "cairn_python_peer"
WARM = 10  # uncounted frames
REPEATS = 20  # of a million points


def frames_per_second(recording: str, count: int) -> float:
    source = cairn.open(recording, frames=count)
    own = []  # arrays outside of the library, as from a camera's driver
    for f in source:
        assert f.depth is not None
        color = None if f.color is None else np.ascontiguousarray(f.color)
        own.append((f.depth.copy(), color, f.time, f.color_delay, f.acceleration))
    mapper = cairn.Mapper(source.rig)
    begin = 0.0
    for i, (depth, color, at, delay, acceleration) in enumerate(own):
        if i == WARM:
            begin = time.perf_counter()
        mapper.add(depth, color, time=at, color_delay=delay, acceleration=acceleration)
    return (len(own) - WARM) / (time.perf_counter() - begin)


def compare_frame_by_frame(recording: str, count: int) -> None:
    """Alternates two mappers, one with arrays, one with Frames as the library's own Mapper::add takes: other load of
    the machine affects both equally."""
    frames = list(cairn.open(recording, frames=count))
    mappers = [cairn.Mapper(cairn.open(recording).rig) for _ in range(2)]
    spent = [0.0, 0.0]
    for i, frame in enumerate(frames):
        assert frame.depth is not None
        depth, color = frame.depth.copy(), None if frame.color is None else np.ascontiguousarray(frame.color)
        for own in (0, 1) if i % 2 == 0 else (1, 0):
            begin = time.perf_counter()
            if own:
                mappers[own].add(
                    depth, color, time=frame.time, color_delay=frame.color_delay, acceleration=frame.acceleration
                )
            else:
                mappers[own].add(frame)
            spent[own] += time.perf_counter() - begin if i >= WARM else 0
    each = [1000 * seconds / (len(frames) - WARM) for seconds in spent]
    print(f"frame by frame: {each[1]:.2f} ms with arrays, {each[0]:.2f} ms without: {100 * each[0] / each[1]:.1f} %")


def points_per_second(vdb: str, file: str, repeats: int) -> float:
    field = cairn.DistanceField.read(vdb)
    points = np.fromfile(file, np.float32).reshape(-1, 3)
    field.query(points)
    begin = time.perf_counter()
    for _ in range(repeats):
        field.query(points)
    return len(points) * repeats / (time.perf_counter() - begin)


def compare(what: str, unit: str, arguments: list[str], rounds: int) -> None:
    ratios, python, library = [], [], []
    for i in range(rounds):
        commands = [[sys.executable, __file__, "--measure"], [str(PEER)]]
        results = {}
        for command in commands[:: 1 if i % 2 == 0 else -1]:  # the second run finds the machine warmer
            ran = subprocess.run([*command, what, *arguments], check=True, capture_output=True, text=True)
            results[len(command)] = float(ran.stdout)
        python.append(results[3])
        library.append(results[1])
        ratios.append(results[3] / results[1])
        print(f"{what}: Python {results[3]:.4g}, C++ {results[1]:.4g} {unit}, {100 * ratios[-1]:.1f} %", flush=True)
    print(
        f"{what}: medians {statistics.median(python):.4g} and {statistics.median(library):.4g} {unit}: "
        f"{100 * statistics.median(python) / statistics.median(library):.1f} %; of the ratios "
        f"{100 * statistics.median(ratios):.1f} %"
    )


def main() -> None:
    if sys.argv[1:2] == ["--measure"]:
        what, *given = sys.argv[2:]
        if what == "frames":
            print(frames_per_second(given[0], int(given[1])))
        else:
            print(points_per_second(given[0], given[1], int(given[2])))
        return
    recording = sys.argv[1]
    frames, rounds = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((2, 200), (3, 5)))
    for _ in range(3):
        compare_frame_by_frame(recording, frames)
    compare("frames", "frames/s", [recording, str(frames)], rounds)
    with tempfile.TemporaryDirectory() as folder:
        source = cairn.open(recording, frames=frames)
        mapper = cairn.Mapper(source.rig)
        for frame in source:
            mapper.add(frame)
        field = mapper.distances()
        bounds = field.bounds
        assert bounds is not None
        candidates = np.random.default_rng(1).uniform(*bounds, (20_000_000, 3)).astype(np.float32)
        points = candidates[field.query(candidates)[2]][:1_000_000]  # known points, a typical query
        print(f"{len(points)} points in a field with voxels of {field.voxel_size:.3f} m")
        field.write(Path(folder) / "field.vdb")
        points.tofile(Path(folder) / "points.f32")
        compare("distances", "points/s", [f"{folder}/field.vdb", f"{folder}/points.f32", str(REPEATS)], 2 * rounds)


if __name__ == "__main__":
    main()
