#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Checks without Clang that the sources listed in tests/fuzz/CMakeLists.txt link: they define each symbol of Cairn that
they use. Prints each undefined symbol with its user.

Usage: tests/fuzz/check_sources.py BUILD_FOLDER     after the build of the library
"""
import pathlib
import re
import subprocess
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
OBJECTS = pathlib.Path(sys.argv[1]) / "CMakeFiles/cairn.dir/src"


def symbols(object_file):
    """Kind and demangled name of each symbol of Cairn."""
    for line in subprocess.run(["nm", "-C", object_file], capture_output=True, text=True, check=True).stdout.splitlines():
        if found := re.match(r"[0-9a-f ]{16} (\w) (cairn::.*)", line):
            yield found[1], re.sub(r"\[abi:\w+\]", "", found[2])


listed = re.findall(r"[\w/]+/\w+\.cpp", (FOLDER / "CMakeLists.txt").read_text())
objects = [o for o in (OBJECTS / f"{name}.o" for name in dict.fromkeys(listed)) if o.exists()]
if len(objects) < len(listed) / 2:
    sys.exit(f"{OBJECTS}: has few of the listed sources; build the library first")
replaced = set(re.findall(r"(\w+)\([^\n]*\) \{", (FOLDER / "no_scenes.cpp").read_text()))
defined, used = set(), {}
for file in objects:
    for kind, name in symbols(file):
        if kind == "U":
            used.setdefault(name, file.relative_to(OBJECTS))
        else:
            defined.add(name)
undefined = sorted(n for n in used.keys() - defined if re.split(r"::|\(", n)[1] not in replaced)
for name in undefined:
    print(f"{used[name]}: uses {name}, whose source tests/fuzz/CMakeLists.txt does not list")
sys.exit(1 if undefined else 0)
