# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Quality of maps by voxel size: a table and a figure, against the exact truth of a synthetic room.

Usage: evaluation_table.py [--frames N] [--voxel-sizes M ...] [--out FOLDER]
"""
from __future__ import annotations

import argparse
import time
from pathlib import Path

import cairn
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--frames", type=int, default=90)
    arguments.add_argument("--width", type=int, default=320)
    arguments.add_argument("--voxel-sizes", type=float, nargs="+", default=[0.01, 0.02, 0.04])
    arguments.add_argument("--out", type=Path, default=Path("out/evaluation"))
    a = arguments.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    recording = cairn.synth("room", a.out / "recording", frames=a.frames, width=a.width, overwrite=True)

    print("voxel   ATE cm  RPE cm  accuracy mm  F 1 cm  F 5 cm  triangles  frames/s")
    figure, (paths, scores) = plt.subplots(1, 2, figsize=(10, 4))
    truth = cairn.recorded_truth(recording)
    paths.plot(truth.poses[:, 0, 3], truth.poses[:, 2, 3], "k", linewidth=3, alpha=0.3, label="truth")
    for voxel_size in a.voxel_sizes:
        source = cairn.open(recording)
        mapper = cairn.Mapper(source.rig, voxel_size=voxel_size)
        begin = time.perf_counter()
        for frame in source:
            mapper.add(frame)
        rate = a.frames / (time.perf_counter() - begin)
        error = cairn.evaluate.map(mapper.map(), recording, samples=50000)
        t, m = error.trajectory, error.mesh
        print(
            f"{voxel_size:5.3f} {100 * t.ate.rmse:8.2f}{100 * t.rpe_translation.rmse:8.2f}"
            f"{1000 * m.accuracy.mean:13.1f}"
            f"{100 * m.at[0].f_score:8.1f}{100 * m.at[2].f_score:8.1f}{len(mapper.mesh().triangles):11}{rate:10.1f}"
        )
        aligned = t.truth_from_estimate @ mapper.trajectory().poses
        paths.plot(aligned[:, 0, 3], aligned[:, 2, 3], label=f"{voxel_size} m")
        scores.plot(
            np.array([at.threshold for at in m.at]) * 100, [at.f_score for at in m.at], "o-", label=f"{voxel_size} m"
        )
    paths.set(xlabel="x, m", ylabel="z, m", title="Path", aspect="equal")
    scores.set(xlabel="threshold, cm", ylabel="F-score", title="Surface", ylim=(0, 1))
    for axes in (paths, scores):
        axes.legend()
    figure.tight_layout()
    figure.savefig(a.out / "evaluation.png", dpi=120)
    print(a.out / "evaluation.png")


if __name__ == "__main__":
    main()
