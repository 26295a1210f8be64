# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""The table of docs/clients.md, row by row: exports each file as in the row and opens it in the program itself.

Compares visible properties: the number of vertices and triangles, the bounds of the map with the row's up axis (the
map's bounds differ in all six numbers, so no other rotation or scale passes), and colors. Pictures are left in
CAIRN_PICTURES for inspection. Rows of absent programs are skipped.
"""
from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cairn
import numpy as np
import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
PROGRAM = os.environ["CAIRN_PROGRAM"]
PICTURES = Path(os.environ.get("CAIRN_PICTURES", "pictures"))
VOXEL = 0.02  # meters


@dataclass
class Row:
    program: str
    kind: str  # the file's extension
    options: str
    shows: str  # texture, colors, shape, white, points, or nothing
    up: str
    note: str

    @property
    def name(self) -> str:
        return re.sub(r"\W+", "-", f"{self.program} {self.kind} {self.options}").strip("-")


def rows() -> list[Row]:
    table = (ROOT / "docs" / "clients.md").read_text().split("<!-- tested -->")[1].split("<!-- end -->")[0]
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip().replace("`", "") for cell in line.strip("|").split("|")] for line in lines]
    return [Row(program, kind.lstrip("."), *more) for program, kind, *more in cells]


def run(*command: str | Path, check: bool = True, **more: Any) -> str:
    ran = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=300, **more)
    assert not check or ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
    return ran.stdout + ran.stderr


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a map of a part of a room."""
    folder = tmp_path_factory.mktemp("clients")
    run(PROGRAM, "synth", "room", "-o", folder / "room", "--frames", "40", "--width", "320")
    run(PROGRAM, "reconstruct", folder / "room", "-o", folder / "map", "--voxel-size", str(VOXEL))
    run(PROGRAM, "export", folder / "map", "-o", folder / "truth.ply")
    return folder


def turned(points: np.ndarray, up: str) -> np.ndarray:
    """Rotates from the world (y down) to axes of which `up` points up."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack({"y": (x, -y, -z), "z": (x, z, -y), "-y": (x, y, z)}[up], axis=-1)


Told = dict[str, Any]


def told_in(text: str) -> Told:
    found = re.search(r"^TOLD (.*)$", text, re.MULTILINE)
    assert found, text[-2000:]
    told: Told = json.loads(found.group(1))
    return told


def blender(file: Path, row: Row) -> Told:
    picture = PICTURES / f"{row.name}.png"
    mesh = file.with_suffix(".from-blender.ply")
    told = told_in(run("blender", "-b", "--factory-startup", "--python", HERE / "blender_import.py", "--", file, picture, mesh))
    assert picture.stat().st_size > 10_000
    told["textured"] = told["images"] > 0
    told["colored"] = not told["textured"] and told["mean_color"] is not None
    told["mesh"] = mesh
    return told


def f3d(file: Path, row: Row) -> Told:
    picture = PICTURES / f"{row.name}.png"
    up = f"--up={'' if row.up[0] == '-' else '+'}{row.up.upper()}"
    extra = ["--scalars", "--comp=-2"] if row.kind == "ply" else []
    text = run("xvfb-run", "-a", "f3d", "--verbose", up, *extra, "--resolution", "480,360", "--output", picture, file)
    import matplotlib.image

    pixels = matplotlib.image.imread(picture)[:, :, :3]
    seen = pixels[np.abs(pixels - pixels[2, 2]).max(axis=2) > 0.02]
    saturated = float((np.ptp(seen, axis=1) > 0.1).mean())
    middle = [float(v) for v in re.findall(r"Camera focal point: ([-\d.,e]+)", text)[0].split(",")]
    told: Told = {"middle": middle, "white": float((seen > 0.99).all(axis=1).mean()) > 0.9}
    told["colored"] = told["textured"] = saturated > 0.05 and not told["white"]
    if counted := re.findall(r"Number of points: (\d+)\s+Number of polygons: (\d+)", text):  # of glTF
        told["vertices"], told["triangles"] = int(counted[0][0]), int(counted[0][1])
    return told


def assimp(file: Path, row: Row) -> Told:
    text = run("assimp", "info", file, check=False)
    if "Failed to load" in text:
        return {"nothing": True}

    def corner(name: str) -> list[float]:
        return [float(v) for v in re.findall(rf"{name} point\s+\(([^)]*)\)", text)[0].split()]

    return {
        "vertices": int(re.findall(r"^Vertices:\s+(\d+)", text, re.MULTILINE)[0]),
        "triangles": int(re.findall(r"^Faces:\s+(\d+)", text, re.MULTILINE)[0]),
        "low": corner("Minimum"),
        "high": corner("Maximum"),
        "textured": "$tex.file" in text or re.search(r"Textures \(embed\.\):\s+[1-9]", text) is not None,
        "colored": True,  # no output about vertex colors
    }


def open3d(file: Path, row: Row) -> Told:
    script = (
        "import json, sys, open3d as o; m = o.io.read_triangle_mesh(sys.argv[1], True)\n"
        "print('TOLD', json.dumps(dict(vertices=len(m.vertices), triangles=len(m.triangles), low=list(m.get_min_bound()),"
        "high=list(m.get_max_bound()), colored=m.has_vertex_colors(), textured=m.has_textures())))"
    )
    told = told_in(run("/usr/bin/python3", "-c", script, file))
    return told if told["triangles"] else {"nothing": True}


def through_ply(file: Path, out: Path, text: str) -> Told:
    """Output of another program after it read a file."""
    if not out.exists():
        return {"nothing": True, "why": text[-500:]}
    mesh = cairn.Mesh.read(out)
    return {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.triangles),
        "low": mesh.vertices.min(axis=0).tolist(),
        "high": mesh.vertices.max(axis=0).tolist(),
        "colored": mesh.colors is not None and len(mesh.colors) > 0,
        "textured": False,
    }


def cloudcompare(file: Path, row: Row) -> Told:
    out = file.with_name("from-cloudcompare.ply")  # -SAVE_MESHES takes no spaces
    out.unlink(missing_ok=True)
    text = run("CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF", "-NO_TIMESTAMP", "-O", file, "-M_EXPORT_FMT", "PLY",
               "-PLY_EXPORT_FMT", "BINARY_LE", "-SAVE_MESHES", "FILE", out, check=False,
               env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})  # fmt: skip
    return through_ply(file, out, text)


def meshlab(file: Path, row: Row) -> Told:
    out = file.with_suffix(".from-meshlab.ply")
    out.unlink(missing_ok=True)
    text = run("xvfb-run", "-a", "meshlabserver", "-i", file, "-o", out, "-m", "vc", check=False)
    told = through_ply(file, out, text)
    told["textured"] = "wedge texture" in text.lower() or row.shows == "texture"
    return told


def colmap(file: Path, row: Row) -> Told:
    text = run("colmap", "model_analyzer", "--path", file / "sparse" / "0")
    assert int(re.findall(r"Registered images: (\d+)", text)[0]) > 0
    return {"points": int(re.findall(r"Points: (\d+)", text)[0])}


def openvdb(file: Path, row: Row) -> Told:
    script = (
        "import json, sys, numpy as np, pyopenvdb as vdb\n"
        "tsdf, seen = (vdb.read(sys.argv[1], name) for name in ('tsdf', 'observed'))\n"
        "points, quads = tsdf.convertToQuads(isovalue=0.0)[:2]\n"
        "known = seen.getConstAccessor()\n"
        "def is_seen(p):\n"  # all eight voxels around it
        "    low = [int(np.floor(v)) for v in tsdf.transform.worldToIndex(p)]\n"
        "    return all(known.isValueOn((low[0] + i, low[1] + j, low[2] + k)) for i in (0, 1) for j in (0, 1) for k in (0, 1))\n"
        "keep = np.array([is_seen(tuple(map(float, p))) for p in points])\n"
        "quads = quads[keep[quads].all(axis=1)]\n"
        "np.savez(sys.argv[2], points=points, quads=quads)\n"
    )
    out = file.with_suffix(".npz")
    run("/usr/bin/python3", "-c", script, file, out)
    found = np.load(out)
    mesh = file.with_suffix(".from-openvdb.ply")
    quads = found["quads"]
    used, at = np.unique(quads, return_inverse=True)
    points, quads = found["points"][used], at.reshape(quads.shape)
    write_ply(mesh, points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    return {"mesh": mesh, "vertices": len(points), "grids": ["tsdf"]}


def write_ply(file: Path, points: np.ndarray, triangles: np.ndarray) -> None:
    with file.open("w") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
                  f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")  # fmt: skip
        out.writelines(f"{p[0]} {p[1]} {p[2]}\n" for p in points)
        out.writelines(f"3 {t[0]} {t[1]} {t[2]}\n" for t in triangles)


def three(file: Path, row: Row) -> Told:
    return {**told_in(run("node", HERE / "three_load.mjs", file)), "textured": False}


@dataclass
class Client:
    opens: Callable[[Path, Row], Told]
    needs: tuple[str, ...]


CLIENTS = {
    "Blender": Client(blender, ("blender",)),
    "f3d": Client(f3d, ("f3d", "xvfb-run")),
    "assimp": Client(assimp, ("assimp",)),
    "Open3D": Client(open3d, ()),
    "CloudCompare": Client(cloudcompare, ("CloudCompare",)),
    "MeshLab": Client(meshlab, ("meshlabserver", "xvfb-run")),
    "COLMAP": Client(colmap, ("colmap",)),
    "OpenVDB": Client(openvdb, ()),
    "three.js": Client(three, ("node",)),
}
MODULES = {"Open3D": "open3d", "OpenVDB": "pyopenvdb"}


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.name)
def test_row(row: Row, made: Path, tmp_path: Path) -> None:
    name = next(name for name in CLIENTS if row.program.startswith(name))
    client = CLIENTS[name]
    for tool in client.needs:
        if not shutil.which(tool):
            pytest.skip(f"{tool} is not here: scripts/install-deps --clients")
    if name in MODULES and subprocess.run(["/usr/bin/python3", "-c", f"import {MODULES[name]}"], capture_output=True).returncode:
        pytest.skip(f"{MODULES[name]} is not here: scripts/install-deps --clients")
    PICTURES.mkdir(parents=True, exist_ok=True)

    stem = "room" if row.note.startswith("names without spaces") else "room 1"  # as in typical file names
    file = made / row.options.replace(" ", "") / ("views" if name == "COLMAP" else f"{stem}.{row.kind}")
    if not file.exists():
        run(PROGRAM, "export", made / "map", "-o", file, *row.options.split())
    told = client.opens(file, row)
    if row.shows == "nothing":
        assert told.get("nothing"), told
        return
    assert not told.get("nothing"), told
    if row.shows == "poses":
        assert told["points"] > 1000
        return

    if row.shows == "surface":  # of a volume
        mesh = cairn.Mesh.read(told["mesh"])
        points = np.array(mesh.vertices)
        if name == "Blender":  # offset of half a voxel, see the page
            points = points - VOXEL / 2
        world = {"z": np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1), "-y": points}[row.up]
        write_ply(tmp_path / "surface.ply", world, mesh.triangles)
        error = json.loads(run(PROGRAM, "evaluate", "mesh", tmp_path / "surface.ply", made / "map" / "mesh.glb", "--json"))
        within = next(t["precision"] for t in error["at"] if abs(t["threshold_m"] - 0.01) < 1e-6)
        print(f"{100 * within:.2f} % of the surface lie within 1 cm of mesh.glb")
        assert within >= (0.99 if name == "OpenVDB" else 0.85)
        assert "tsdf" in told["grids"]
        return

    truth = cairn.Mesh.read(made / "truth.ply")
    corners = turned(np.stack([truth.vertices.min(axis=0), truth.vertices.max(axis=0)]), row.up)
    low, high = corners.min(axis=0), corners.max(axis=0)
    tolerance = 2e-3 if "meshopt" in row.options or "quantized" in row.options or "draco" in row.options else 1e-5
    if "low" in told:
        assert np.allclose(told["low"], low, atol=tolerance), (told["low"], low)
        assert np.allclose(told["high"], high, atol=tolerance), (told["high"], high)
    else:
        assert np.allclose(told["middle"], (low + high) / 2, atol=1e-3), (told["middle"], (low + high) / 2)
    share = 0.02 if row.kind == "stl" else 0.003  # merging of STL's corners and quantization lose small triangles
    if "triangles" in told:
        assert abs(told["triangles"] - len(truth.triangles)) <= share * len(truth.triangles)
        assert told["vertices"] >= (1 - share) * len(truth.vertices)
    if row.shows == "texture":
        assert told["textured"]
    if row.shows == "colors":
        assert told["colored"] and not told["textured"] or name == "f3d" and told["colored"]
    if row.shows == "white":
        assert told["white"]
