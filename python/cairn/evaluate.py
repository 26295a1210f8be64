# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Evaluates trajectories, meshes and maps against the truth. File names are accepted in place of objects where
possible."""
from __future__ import annotations

import collections.abc
import os
from dataclasses import dataclass
from typing import Union

from . import _cairn
from ._cairn import (
    DistanceError,
    DistanceField,
    LoopError,
    Map,
    Mapper,
    Mesh,
    MeshError,
    MeshTopology,
    Scene,
    Source,
    Trajectory,
    TrajectoryError,
    ViewError,
)

__all__ = ["MapError", "distances", "loops", "map", "mesh", "topology", "trajectory", "views"]

_Path = Union[str, "os.PathLike[str]"]


def _trajectory_of(poses: Trajectory | _Path) -> Trajectory:
    return poses if isinstance(poses, Trajectory) else _cairn.recorded_truth(poses)


def _mesh_of(mesh: Mesh | _Path) -> Mesh:
    return mesh if isinstance(mesh, Mesh) else Mesh.read(mesh)


def _scene_of(scene: Scene | str) -> Scene:
    return scene if isinstance(scene, Scene) else Scene(scene)


def trajectory(
    estimate: Trajectory | _Path,
    truth: Trajectory | _Path,
    *,
    rpe_interval: float = 1.0,
    max_time_difference: float = 0.02,
) -> TrajectoryError:
    """ATE and RPE as defined by the TUM benchmark (Sturm et al. 2012).

    truth: a Trajectory, its file, or a recording with true poses. rpe_interval, max_time_difference: seconds. Raises
    Error if fewer than three poses match.
    """
    return _cairn.evaluate_trajectory(
        _trajectory_of(estimate), _trajectory_of(truth), rpe_interval, max_time_difference
    )


def mesh(
    estimate: Mesh | _Path, truth: Mesh | _Path, *, samples: int = 200000, seen: Mesh | _Path | None = None
) -> MeshError:
    """Accuracy, completeness and F-score of a mesh in the truth's frame.

    samples: points on each surface, seeded. seen: the part of the truth seen by the camera, on which completeness is
    measured; None: all.
    """
    return _cairn.evaluate_mesh(_mesh_of(estimate), _mesh_of(truth), samples, None if seen is None else _mesh_of(seen))


def topology(mesh: Mesh | _Path) -> MeshTopology:
    """Topology of a mesh; vertices at the same position count as a single vertex."""
    return _cairn.examine_topology(_mesh_of(mesh))


def distances(field: DistanceField, scene: Scene | str, seen: Mesh | _Path) -> DistanceError:
    """Compares a distance field in a scene's frame with the scene's exact distances.

    seen: the part of the scene's surface seen by the camera (groundtruth_seen.ply of cairn.synth).
    """
    return _cairn.evaluate_distances(field, _scene_of(scene), _mesh_of(seen))


def loops(mapper: Mapper, truth: Trajectory | _Path, *, max_time_difference: float = 0.1) -> LoopError:
    """Precision and recall of a mapper's loop closures."""
    return _cairn.evaluate_loops(mapper.loops(), mapper.keyframes(), _trajectory_of(truth), max_time_difference)


def views(
    mesh: Mesh | collections.abc.Sequence[Mesh] | _Path,
    recording: Source,
    *,
    world_from_recording: object = None,
    step: int = 10,
) -> ViewError:
    """PSNR of renderings of a textured mesh against the images of a recording with poses.

    world_from_recording: (4, 4), moves the recording's poses to the mesh. step: compares every step-th frame.
    """
    if isinstance(mesh, Mesh):
        parts = [mesh]
    elif isinstance(mesh, (str, os.PathLike)):
        parts = Mesh.read_parts(mesh)
    else:
        parts = list(mesh)
    return _cairn.evaluate_views(parts, recording, world_from_recording, step)


@dataclass(frozen=True)
class MapError:
    """Errors of a map against the exact scene of a synthetic recording: result of map().

    The C++ MapError compares a map with its own recording instead.
    """

    trajectory: TrajectoryError
    mesh: MeshError
    topology: MeshTopology


def map(map: Map, truth: _Path, *, samples: int = 200000) -> MapError:
    """Evaluates the path and the surface of a map of a synthetic recording, after alignment by all poses.

    truth: the folder made by cairn.synth.
    """
    import numpy as np  # imported on demand, to keep the import of cairn fast

    poses, true_poses, surface = map.trajectory(), _cairn.recorded_truth(truth), map.mesh()
    aligned = surface.transformed(np.linalg.inv(_cairn.estimate_from_truth(poses, true_poses)))
    folder = os.fspath(truth)
    true_mesh, seen = (os.path.join(folder, f"groundtruth_{name}.ply") for name in ("mesh", "seen"))
    error = mesh(aligned, true_mesh, samples=samples, seen=seen)
    return MapError(trajectory(poses, true_poses), error, topology(surface))
