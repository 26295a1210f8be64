# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Path of a robot through a map, by A* on its distance field: short, and at a distance from obstacles.

Usage: plan_a_path.py [MAP] [--height M] [--radius M]
MAP is a folder made by cairn reconstruct; without MAP a synthetic room.
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
    """Cheapest path over cells; cells with infinite cost are blocked. Empty if there is no path."""
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    costs: dict[Cell, float] = {start: 0.0}
    previous: dict[Cell, Cell] = {}
    queue = [(0.0, start)]
    while queue:
        _, cell = heapq.heappop(queue)
        if cell == goal:
            path = [cell]
            while path[-1] != start:
                path.append(previous[path[-1]])
            return path[::-1]
        for i, j in steps:
            to = (cell[0] + i, cell[1] + j)
            if not (0 <= to[0] < cost.shape[0] and 0 <= to[1] < cost.shape[1]) or not np.isfinite(cost[to]):
                continue
            total = costs[cell] + np.hypot(i, j) * cost[to]
            if total < costs.get(to, np.inf):
                costs[to], previous[to] = total, cell
                heapq.heappush(queue, (total + np.hypot(goal[0] - to[0], goal[1] - to[1]), to))
    return []


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("map", nargs="?")
    arguments.add_argument("--height", type=float, default=0.0, help="meters above the first camera")
    arguments.add_argument("--radius", type=float, default=0.15, help="meters, of the robot")
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

    # From one end of the largest free component to its other end.
    components, count = ndimage.label(free, np.ones((3, 3)))
    assert count > 0, "no free cells at this height"
    cells: NDArray[Any] = np.argwhere(components == 1 + np.argmax(np.bincount(components[free])[1:]))
    along = cells @ np.array([1.0, 1.0])
    start, goal = (tuple(int(i) for i in cells[pick]) for pick in (np.argmin(along), np.argmax(along)))
    path_cells = a_star(cost, (start[0], start[1]), (goal[0], goal[1]))
    path = np.array([points[cell] for cell in path_cells])
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    clearance = min(distance[cell] for cell in path_cells)
    print(f"{free.sum()} of {free.size} cells of {size:.2f} m are free, {(~known).sum()} unknown")
    print(f"{len(path_cells)} cells, {length:.2f} m, clearance {clearance:.2f} m")
    for point in path[:: max(1, len(path) // 8)]:
        print(f"  x {point[0]:6.2f}  z {point[2]:6.2f}")
    assert clearance > a.radius and len(path_cells) > 2


if __name__ == "__main__":
    main()
