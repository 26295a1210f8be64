# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Dense volumetric RGB-D mapping: from a stream of depth and color images to one map.

    import cairn
    mapper = cairn.Mapper(cairn.Rig.kinect_v1(), voxel_size=0.01)
    for frame in cairn.open("recording"):            # or own arrays: mapper.add(depth, color, time=t, guess=T)
        r = mapper.add(frame)                        # r.pose: 4x4 or None, r.state, r.covariance
    m = mapper.mesh()                                # m.vertices (N, 3) float32, m.triangles, m.colors, m.normals
    d, g, known = mapper.distances(points)           # a million points: one call
    mapper.map().export("room.glb", texture=True)
    cairn.reconstruct("recording", "out", texture=True, progress=True)

Where to start
    Mapper                     maps frames; Session resumes a map in a later program; Localizer finds frames in it
    open, Frame, Source        recordings, sensors, scenes; own arrays
    Map, Mesh, DistanceField   results: surface, voxels, distances, files
    LiveViewer, MapViewer      pages in a browser: a growing, a finished map; LiveSurface: changed blocks of the surface
    reconstruct, merge, synth  runs of the program `cairn`, in a child process
    find_calibration           cameras of a sensor; find_shutter, find_depth_correction, find_color_camera
    evaluate                   trajectories, meshes and maps against the truth
    Scene, SceneCamera         scenes with an exactly known surface
    PoseGraph                  poses connected by measured relative poses
    train_splats, Splats       Gaussian splats of a map

Conventions
    Lengths are meters, times seconds, angles radians. The camera's frame is x right, y down, z forward, as in OpenCV;
    the world is y down, too. Poses are (4, 4) float64 and named by their use: world_from_camera @ point_in_camera.
    Depth is meters along z, 0 without a measurement; color is uint8 R, G, B (sRGB). Arrays of a Frame, Mesh,
    Trajectory or Voxels are views of its memory and keep it alive.

    Long calls release the interpreter; calls that use the same mapper wait for each other. Failures outside of the
    program raise Error with one line: cause, place and remedy. Arrays of a wrong shape or type raise
    ValueError or TypeError.
"""
from . import evaluate
from ._cairn import (
    AdjustReport,
    AlignmentFit,
    AtThreshold,
    Camera,
    ColorCamera,
    DenseGrid,
    DepthCorrection,
    Device,
    DistanceError,
    DistanceField,
    Edge,
    Error,
    ErrorStatistics,
    EsdfOptions,
    ExportReport,
    ExportViewsReport,
    FinishReport,
    FoundCalibration,
    FoundDepthCorrection,
    FoundShutter,
    Frame,
    FrameReport,
    FuseOptions,
    GravityAlignment,
    HeldOutError,
    InertialReport,
    LayoutWriter,
    LiveSurface,
    LiveViewer,
    LocalizedFrame,
    Localizer,
    Loop,
    LoopError,
    Map,
    MapOptions,
    MapViewer,
    Mapper,
    MergedSession,
    Mesh,
    MeshError,
    MeshTopology,
    MotionOptions,
    OptimizeReport,
    Options,
    PoseGraph,
    Recorder,
    RefineReport,
    Rig,
    Scene,
    SceneCamera,
    SceneImages,
    SensorModel,
    Session,
    SessionInfo,
    Source,
    SourceSummary,
    SplatReport,
    Splats,
    Statistics,
    SurfaceBlock,
    SurfaceChanges,
    SurfaceOptions,
    TrackOptions,
    Trajectory,
    TrajectoryError,
    ViewError,
    ViewerCommands,
    ViewerStats,
    Voxels,
    __version__,
    devices,
    find_calibration,
    find_color_camera,
    find_depth_correction,
    find_shutter,
    inspect,
    known_cameras,
    layouts,
    merge_sessions,
    open,
    recorded_truth,
    train_splats,
)
from .evaluate import MapError
from .runs import Frames, Report, merge, program, reconstruct, run, synth

__all__ = [
    "AdjustReport",
    "AlignmentFit",
    "AtThreshold",
    "Camera",
    "ColorCamera",
    "DenseGrid",
    "DepthCorrection",
    "Device",
    "DistanceError",
    "DistanceField",
    "Edge",
    "Error",
    "ErrorStatistics",
    "EsdfOptions",
    "ExportReport",
    "ExportViewsReport",
    "FinishReport",
    "FoundCalibration",
    "FoundDepthCorrection",
    "FoundShutter",
    "Frame",
    "FrameReport",
    "Frames",
    "FuseOptions",
    "GravityAlignment",
    "HeldOutError",
    "InertialReport",
    "LayoutWriter",
    "LiveSurface",
    "LiveViewer",
    "LocalizedFrame",
    "Localizer",
    "Loop",
    "LoopError",
    "Map",
    "MapError",
    "MapOptions",
    "MapViewer",
    "Mapper",
    "MergedSession",
    "Mesh",
    "MeshError",
    "MeshTopology",
    "MotionOptions",
    "OptimizeReport",
    "Options",
    "PoseGraph",
    "Recorder",
    "RefineReport",
    "Report",
    "Rig",
    "Scene",
    "SceneCamera",
    "SceneImages",
    "SensorModel",
    "Session",
    "SessionInfo",
    "Source",
    "SourceSummary",
    "SplatReport",
    "Splats",
    "Statistics",
    "SurfaceBlock",
    "SurfaceChanges",
    "SurfaceOptions",
    "TrackOptions",
    "Trajectory",
    "TrajectoryError",
    "ViewError",
    "ViewerCommands",
    "ViewerStats",
    "Voxels",
    "__version__",
    "devices",
    "evaluate",
    "find_calibration",
    "find_color_camera",
    "find_depth_correction",
    "find_shutter",
    "inspect",
    "known_cameras",
    "layouts",
    "merge",
    "merge_sessions",
    "open",
    "program",
    "reconstruct",
    "recorded_truth",
    "run",
    "synth",
    "train_splats",
]

for _name in __all__:  # shown and found as cairn.Mapper
    if getattr(globals()[_name], "__module__", "").startswith("cairn."):
        globals()[_name].__module__ = "cairn"
del _name
