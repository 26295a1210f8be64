# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Path of a robot through a map, by A* on its distance field: short, and at a distance from obstacles.

Usage: plan_a_path.py [MAP] [--height M] [--radius M]
MAP is a folder made by cairn reconstruct; without MAP a synthetic room is mapped.
"""
from __future__ import annotations

import argparse
import heapq
from typing import Any

import cairn
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Cell = tuple[int, int]


def map_a_room(frames: int) -> cairn.DistanceField:
    source = cairn.open("synthetic:room", frames=frames)
    mapper = cairn.Mapper(source.rig, voxel_size=0.04)
    for frame in source:
        mapper.add(frame)
    return mapper.distances(robot_radius=0.25)


def a_star(cost: NDArray[np.float64], start: Cell, goal: Cell) -> list[Cell]:
    """Cheapest path over cells, where infinite costs are closed; empty if there is no path."""
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    reached: dict[Cell, float] = {start: 0.0}
    before: dict[Cell, Cell] = {}
    waiting = [(0.0, start)]
    while waiting:
        _, cell = heapq.heappop(waiting)
        if cell == goal:
            way = [cell]
            while way[-1] != start:
                way.append(before[way[-1]])
            return way[::-1]
        for i, j in steps:
            to = (cell[0] + i, cell[1] + j)
            if not (0 <= to[0] < cost.shape[0] and 0 <= to[1] < cost.shape[1]) or not np.isfinite(cost[to]):
                continue
            so_far = reached[cell] + np.hypot(i, j) * cost[to]
            if so_far < reached.get(to, np.inf):
                reached[to], before[to] = so_far, cell
                heapq.heappush(waiting, (so_far + np.hypot(goal[0] - to[0], goal[1] - to[1]), to))
    return []


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("map", nargs="?")
    arguments.add_argument("--height", type=float, default=0.0, help="metres above the first camera")
    arguments.add_argument("--radius", type=float, default=0.15, help="metres, of the robot")
    arguments.add_argument("--frames", type=int, default=120)
    a = arguments.parse_args()
    field = cairn.Map.open(a.map).distances(robot_radius=0.25) if a.map else map_a_room(a.frames)

    # Query all cells of a horizontal slice in one call. The world is y down.
    bounds = field.bounds
    assert bounds is not None, "the map is empty"
    size = field.voxel_size
    x, z = np.arange(bounds[0, 0], bounds[1, 0], size), np.arange(bounds[0, 2], bounds[1, 2], size)
    points = np.stack(np.meshgrid(x, [-a.height], z, indexing="ij"), axis=-1).astype(np.float32)[:, 0]
    distance, _, known = field.query(points)  # NaN in unobserved space: unknown is not free
    free = known & (distance > a.radius)
    cost = np.where(free, 1 + 2 * np.exp(-(distance - a.radius) / 0.2), np.inf)

    # From one end of the largest free part to its other end.
    parts, count = ndimage.label(free, np.ones((3, 3)))
    assert count > 0, "nothing is free at this height"
    cells: NDArray[Any] = np.argwhere(parts == 1 + np.argmax(np.bincount(parts[free])[1:]))
    along = cells @ np.array([1.0, 1.0])
    start, goal = (tuple(int(i) for i in cells[pick]) for pick in (np.argmin(along), np.argmax(along)))
    way = a_star(cost, (start[0], start[1]), (goal[0], goal[1]))
    path = np.array([points[cell] for cell in way])
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    least = min(distance[cell] for cell in way)
    print(f"{free.sum()} of {free.size} cells of {size:.2f} m are free, {(~known).sum()} unknown")
    print(f"{len(way)} cells, {length:.2f} m, never nearer than {least:.2f} m")
    for place in path[:: max(1, len(path) // 8)]:
        print(f"  x {place[0]:6.2f}  z {place[2]:6.2f}")
    assert least > a.radius and len(way) > 2


if __name__ == "__main__":
    main()
