# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Maps all recordings of a folder in turn and prints a table of the results.

Usage: many_recordings.py [FOLDER] [--out FOLDER] [--voxel-size M]; without FOLDER two synthetic recordings
"""
from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import cairn


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("folder", nargs="?", type=Path)
    arguments.add_argument("--out", type=Path, default=Path("out/many"))
    arguments.add_argument("--frames", type=int, default=None)
    arguments.add_argument("--voxel-size", type=float, default=0.02)
    a = arguments.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    folder = a.folder
    if folder is None:
        folder = a.out / "recordings"
        for scene in ("room", "sphere"):
            cairn.synth(scene, folder / scene, frames=a.frames or 40, width=320, overwrite=True)

    rows = []
    for recording in sorted(folder.iterdir()):
        try:
            report = cairn.reconstruct(
                recording, a.out / "maps" / recording.name, voxel_size=a.voxel_size, frames=a.frames, overwrite=True
            )
        except cairn.Error as error:  # no recording, or an unusable one: continue with the rest
            print(f"{recording.name:20} {error}", file=sys.stderr)
            continue
        rows.append(
            [
                recording.name,
                report.level,
                report.frames.fused,
                report.frames.total,
                report.triangles,
                f"{report.seconds:.1f}",
            ]
        )
        print(f"{recording.name:20} {report.level:5} {report.words}")
        for reason in report.reasons:
            print(f"{'':20} {reason}")
    with (a.out / "table.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["recording", "level", "fused", "frames", "triangles", "seconds"], *rows])
    print(a.out / "table.csv")
    sys.exit(0 if rows else 1)


if __name__ == "__main__":
    main()
