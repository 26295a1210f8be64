# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Builds the wheel with CMake (PEP 517) and Python's standard library only.

Settings, each as pip install --config-settings NAME=VALUE:
    build-dir   a build folder, possibly existing [build/wheel-VERSION of Python]
    cmake       an argument for CMake, such as -DCAIRN_VIEWER=OFF
    jobs        number of compilers at once [all cores]
"""
from __future__ import annotations

import base64
import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
Settings = dict[str, Any] | None


def _run(*command: str | Path) -> None:
    print("+", *command, flush=True)
    subprocess.run([str(part) for part in command], cwd=ROOT, check=True)


def _project() -> dict[str, Any]:
    project: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    version = re.search(r"^project\(cairn VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(), re.MULTILINE)
    assert version
    return {**project, "version": version.group(1)}


def _metadata() -> str:
    p = _project()
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {p['name']}",
        f"Version: {p['version']}",
        f"Summary: {p['description']}",
        f"License: {p['license']['text']}",
        f"Requires-Python: {p['requires-python']}",
        *(f"Requires-Dist: {name}" for name in p["dependencies"]),
        "Description-Content-Type: text/markdown",
    ]
    return "\n".join(lines) + "\n\n" + (ROOT / p["readme"]).read_text()


def _tag() -> str:
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{re.sub('[.-]', '_', sysconfig.get_platform())}"


def _built(settings: Settings) -> Path:
    """Builds the wheel's contents, and returns the build folder."""
    settings = settings or {}
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    build = Path(settings.get("build-dir", ROOT / "build" / f"wheel-{version}"))
    extra = settings.get("cmake", [])
    extra = [extra] if isinstance(extra, str) else list(extra)
    if not (build / "CMakeCache.txt").exists():
        # The running Python, possibly of a virtual environment.
        extra += [
            "-DCMAKE_BUILD_TYPE=Release",
            "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG",
            "-DCAIRN_TESTS=OFF",
            "-DCAIRN_PYTHON=ON",
            f"-DPython_EXECUTABLE={sys.executable}",
        ]
        extra += ["-G", "Ninja"] if shutil.which("ninja") else []
    if extra:
        _run("cmake", "-S", ROOT, "-B", build, *extra)
    jobs = settings.get("jobs", os.cpu_count())
    _run("cmake", "--build", build, "--parallel", str(jobs), "--target", "cairn_python", "cairn_program")
    module = f"_cairn{sysconfig.get_config_var('EXT_SUFFIX')}"
    if not (build / "python" / "cairn" / module).exists():
        raise SystemExit(f"{build}: was built for another Python, or without Python: remove it, or choose another build-dir")
    return build


class _Wheel:
    """Wheel during writing, with the list of its contents."""

    def __init__(self, file: Path) -> None:
        self.zip = zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED)
        self.info = f"{_project()['name']}-{_project()['version']}.dist-info"
        self.record = ""

    def add(self, name: str, data: bytes, mode: int = 0o644) -> None:
        entry = zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0))  # the same wheel from the same files
        entry.external_attr = (0o100000 | mode) << 16
        entry.compress_type = zipfile.ZIP_DEFLATED
        self.zip.writestr(entry, data)
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        self.record += f"{name},sha256={digest},{len(data)}\n"

    def finish(self) -> None:
        for name, text in _info().items():
            self.add(f"{self.info}/{name}", text.encode())
        self.add(f"{self.info}/LICENSE", (ROOT / "LICENSE").read_bytes())
        self.record += f"{self.info}/RECORD,,\n"
        self.zip.writestr(f"{self.info}/RECORD", self.record)
        self.zip.close()


def _info() -> dict[str, str]:
    """Metadata files of the wheel."""
    scripts = "".join(f"{name} = {target}\n" for name, target in _project()["scripts"].items())
    return {
        "METADATA": _metadata(),
        "WHEEL": f"Wheel-Version: 1.0\nGenerator: cairn\nRoot-Is-Purelib: false\nTag: {_tag()}\n",
        "entry_points.txt": f"[console_scripts]\n{scripts}",
    }


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Settings = None) -> str:
    folder = Path(metadata_directory) / f"{_project()['name']}-{_project()['version']}.dist-info"
    folder.mkdir()
    for name, text in _info().items():
        (folder / name).write_text(text)
    return folder.name


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    build = _built(config_settings)
    p = _project()
    name = f"{p['name']}-{p['version']}-{_tag()}.whl"
    wheel = _Wheel(Path(wheel_directory) / name)
    with tempfile.TemporaryDirectory() as folder:
        for component in ("python", "wheel"):
            _run("cmake", "--install", build, "--component", component, "--prefix", folder, "--strip")
        (package,) = (init.parent for init in Path(folder).rglob("cairn/__init__.py"))
        for file in sorted(path for path in package.rglob("*") if path.is_file()):
            mode = 0o755 if os.access(file, os.X_OK) else 0o644
            wheel.add(f"cairn/{file.relative_to(package).as_posix()}", file.read_bytes(), mode)
    wheel.finish()
    return name


def build_sdist(sdist_directory: str, config_settings: Settings = None) -> str:
    p = _project()
    base = f"{p['name']}-{p['version']}"
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    with tarfile.open(Path(sdist_directory) / f"{base}.tar.gz", "w:gz") as archive:
        for file in files.rstrip("\0").split("\0"):
            archive.add(ROOT / file, f"{base}/{file}")
        with tempfile.NamedTemporaryFile("w") as info:
            info.write(_metadata())
            info.flush()
            archive.add(info.name, f"{base}/PKG-INFO")
    return f"{base}.tar.gz"
