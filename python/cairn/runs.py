# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Runs the program `cairn` as a child process: Ctrl-C ends the run, and all its resources are freed."""
from __future__ import annotations

import collections.abc
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from ._cairn import Error

__all__ = ["Frames", "Report", "merge", "program", "reconstruct", "run", "synth"]

_Path = Union[str, "os.PathLike[str]"]
_BAD = 3  # exit code: most of the recording is not in the map


@dataclass(frozen=True)
class Frames:
    """Number of frames of a run, by result."""

    total: int
    fused: int
    lost: int
    skipped: int
    held_out: int = 0


@dataclass(frozen=True)
class Report:
    """Result of a run, as in report.json."""

    output: Path  #: output folder
    level: str  #: 'good', 'weak' or 'bad'
    words: str  #: result in one sentence
    reasons: list[str]  #: findings with advice, one line each
    frames: Frames
    triangles: int  #: of mesh.glb
    seconds: float
    frames_per_second: float
    warnings: list[str]
    json: dict[str, Any]  #: entire report

    @property
    def mesh(self) -> Path:
        """Path of the surface, as glTF."""
        return self.output / "mesh.glb"

    @property
    def trajectory(self) -> Path:
        """Path of the poses, in the TUM format (Trajectory.read)."""
        return self.output / "trajectory.txt"


def program() -> Path:
    """Path of the program `cairn`: beside the package, in its build folder, or in PATH. CAIRN_PROGRAM overrides it."""
    if chosen := os.environ.get("CAIRN_PROGRAM"):
        return Path(chosen)
    here = Path(__file__).parent  # in a build folder the files are links: the folder is build/release/python/cairn
    for place in (here / "bin" / "cairn", here.parent.parent / "cairn"):
        if place.is_file() and os.access(place, os.X_OK):
            return place
    if found := shutil.which("cairn"):
        return Path(found)
    raise Error("the program cairn was not found: reinstall the package, or add cairn to PATH")


_ON = {"loops"}  # on unless --no-... is given
_AUTOMATIC = {"texture"}  # on where possible


def _flags(options: dict[str, Any]) -> list[str]:
    """voxel_size=0.02 → --voxel-size 0.02, texture=False → --no-texture, frames=slice(0, 9) → --frames 0:9."""
    flags = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is None:
            continue
        if value is True:
            flags += [flag] if name not in _ON else []
        elif value is False:  # most are off by default
            flags += ["--no-" + flag[2:]] if name in _ON | _AUTOMATIC else []
        elif isinstance(value, slice):
            parts = ["" if part is None else str(part) for part in (value.start, value.stop, value.step)]
            flags.append(f"{flag}={':'.join(parts if parts[2] else parts[:2])}")
        elif isinstance(value, (list, tuple)):
            flags += [flag, *(os.fspath(v) if isinstance(v, os.PathLike) else str(v) for v in value)]
        else:
            flags.append(f"{flag}={os.fspath(value) if isinstance(value, os.PathLike) else value}")
    return flags


def _reason(lines: list[str]) -> str:
    """The program's own error line."""
    messages = [line for line in lines if line.strip()]
    for line in reversed(messages):
        if line.startswith("error: "):
            return line[len("error: ") :]
    return messages[-1] if messages else "no message"


def main() -> None:
    """Entry point of `cairn` in a shell for a package installed by pip."""
    os.execv(program(), [str(program()), *sys.argv[1:]])


def run(*arguments: _Path | float, progress: bool = False, expect: collections.abc.Iterable[int] = (0,)) -> str:
    """Runs `cairn` with arguments as in a shell, and returns its standard output.

    progress: copies the program's messages to stderr. expect: exit codes without error. Raises Error with the
    program's error line. Ctrl-C ends the run as in a shell, with the map written; a second Ctrl-C ends it at once.
    """
    # A separate process group: the terminal's Ctrl-C comes once, from here.
    child = subprocess.Popen(
        [str(program()), *(os.fspath(a) if isinstance(a, os.PathLike) else str(a) for a in arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
        errors="replace",
        process_group=0,
    )
    lines: list[str] = []
    written: list[str] = []

    def read_messages() -> None:
        assert child.stderr is not None
        for line in child.stderr:
            lines.append(line.rstrip("\n"))
            if progress:
                sys.stderr.write(line)
                sys.stderr.flush()

    def read_output() -> None:
        assert child.stdout is not None
        written.append(child.stdout.read())

    threads = [threading.Thread(target=work, daemon=True) for work in (read_messages, read_output)]
    for thread in threads:
        thread.start()
    interrupted = False
    while True:
        try:
            code = child.wait()
            for thread in threads:
                thread.join()
            break
        except KeyboardInterrupt:
            interrupted = True
            child.send_signal(signal.SIGINT)
        except BaseException:
            child.kill()
            raise
    if interrupted:
        raise KeyboardInterrupt
    if code not in tuple(expect):
        ended = f"cairn was terminated by {signal.Signals(-code).name}: " if code < 0 else ""
        raise Error(ended + _reason(lines))
    return "".join(written)


def reconstruct(recording: _Path, output: _Path, *, progress: bool = False, **options: Any) -> Report:
    """Maps a recording with the program, into a folder: mesh.glb, map.vdb, trajectory.txt, report.html, ...

    options: of `cairn reconstruct --help`, with underscores: voxel_size=0.02, texture=True, texture=False,
    overwrite=True, frames=100, loops=False, poses="groundtruth.txt". progress: copies the program's messages to
    stderr.

    Returns the Report; its level is 'bad' if most of the recording is not in the map. Raises Error with the
    program's error line, for example if the folder has a map already.
    """
    text = run("reconstruct", recording, "-o", output, "--json", *_flags(options), progress=progress, expect=(0, _BAD))
    report = json.loads(text)
    verdict = report["verdict"]
    return Report(
        output=Path(report.get("output", output)),
        level=verdict["level"],
        words=verdict["words"],
        reasons=list(verdict["reasons"]),
        frames=Frames(**{name: report["frames"][name] for name in ("total", "fused", "lost", "skipped", "held_out")}),
        triangles=report["mesh"]["triangles"],
        seconds=report["seconds"],
        frames_per_second=report["frames_per_second"],
        warnings=list(report["warnings"]),
        json=report,
    )


def merge(maps: collections.abc.Iterable[_Path], output: _Path, *, progress: bool = False, **options: Any) -> Path:
    """Merges maps of the same place and camera with the program. Returns the folder.

    maps: folders made by reconstruct, live or merge; they stay unchanged. options: of `cairn merge --help`.
    """
    run("merge", *maps, "-o", output, *_flags(options), progress=progress)
    return Path(output)


def synth(scene: str, output: _Path, *, progress: bool = False, **options: Any) -> Path:
    """Renders a synthetic recording with exact poses and an exact surface, with the program. Returns the folder.

    scene: as Scene. options: of `cairn synth --help`: frames=60, width=320, noise="kinect", camera="camera.yaml".
    """
    run("synth", scene, "-o", output, *_flags(options), progress=progress)
    return Path(output)
