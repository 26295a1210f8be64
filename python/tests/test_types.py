# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Stubs, module and docstrings agree, and all code using them is typed."""
from __future__ import annotations

import inspect
import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import cairn
import pytest
from test_first_lines import LINES

pytest.importorskip("mypy")

ROOT = Path(__file__).parents[2]
PACKAGE = Path(cairn.__file__).parent
STRICT = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull]


def check(command: list[str], here: Path) -> None:
    environment = {**os.environ, "MYPYPATH": str(PACKAGE.parent)}
    ran = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_package_is_typed(here: Path) -> None:
    check([*STRICT, "-p", "cairn"], here)


def test_first_lines_are_typed(here: Path) -> None:
    given = "import numpy as np\nfrom numpy.typing import NDArray\npoints: NDArray[np.float32]\n"
    Path("first_lines.py").write_text(given + LINES + "reveal_type(r.pose)\nreveal_type(d)\nreveal_type(known)\n")
    ran = subprocess.run(
        [*STRICT, "first_lines.py"], env={**os.environ, "MYPYPATH": str(PACKAGE.parent)}, capture_output=True, text=True
    )
    assert "Success" in ran.stdout, ran.stdout
    assert "Any" not in ran.stdout.replace("ndarray[Any, ", "")


def test_tests_are_typed(here: Path) -> None:
    tests = sorted(Path(__file__).parent.glob("*.py"))
    check([*STRICT, *map(str, tests)], here)


@pytest.mark.skipif(not (ROOT / "examples" / "python").exists(), reason="without the examples")
def test_examples_are_typed(here: Path) -> None:
    check([*STRICT, "--ignore-missing-imports", *map(str, sorted((ROOT / "examples" / "python").glob("*.py")))], here)


def test_stubs_match_the_module(here: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "--concise", "cairn"],
        env={**os.environ, "MYPYPATH": str(PACKAGE.parent)},
        capture_output=True,
        text=True,
    )
    # Differences common to pybind11's classes; classes without constructor have their own __init__. With a Frame no
    # time is given; without a Frame a missing time is detected at runtime.
    expected = (
        r"is inconsistent, metaclass differs$|\.__init__ is inconsistent, stub does not have \*args argument|"
        r'runtime argument "time" has a default value of type None'
    )
    assert "error" not in ran.stderr, ran.stderr
    differences = [line for line in ran.stdout.splitlines() if not re.search(expected, line)]
    assert len(ran.stdout) > 0 and differences == []


def test_everything_public_is_documented() -> None:
    for name in cairn.__all__:
        thing = getattr(cairn, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(thing), name
        if inspect.isfunction(thing) or inspect.isbuiltin(thing):
            inspect.signature(thing)
        if not inspect.isclass(thing) or issubclass(thing, Exception):
            continue
        for member, value in vars(thing).items():
            if not member.startswith("_") and callable(getattr(thing, member)):
                assert inspect.getdoc(getattr(thing, member)), f"{name}.{member}"
                inspect.signature(getattr(thing, member))


def test_help_has_no_internal_names() -> None:
    text = pydoc.plain(pydoc.render_doc(cairn))
    assert "add(self, depth, color=None, *, time=None" in text
    for internal in ("cairn::", "_cairn.", "pybind11::", "arg0"):
        assert internal not in text.replace("pybind11_builtins", ""), internal
