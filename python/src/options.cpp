// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/options.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "module.hpp"

namespace cairn::python {

namespace py = pybind11;

namespace {

void add_stages(py::module_& m) {
  py::class_<SurfaceOptions>(m, "SurfaceOptions", "What becomes of depth images before anything else looks at them.")
      .def_readwrite("min_depth", &SurfaceOptions::min_depth, "Metres; nearer measurements are dropped.")
      .def_readwrite("max_depth", &SurfaceOptions::max_depth, "Metres; farther measurements are dropped.")
      .def_readwrite("filter_sigma_pixels", &SurfaceOptions::filter_sigma_pixels,
                     "Pixels; the width of the bilateral filter.")
      .def_readwrite("filter_range", &SurfaceOptions::filter_range,
                     "Neighbours farther than so many noise sigmas do not count.")
      .def_readwrite("edge_slope", &SurfaceOptions::edge_slope,
                     "A pixel whose neighbours differ by more than so many noise sigmas on both sides is dropped.");
  py::class_<TrackOptions>(m, "TrackOptions", "How frames are aligned with the map.")
      .def_readwrite("levels", &TrackOptions::levels, "Pyramid levels, each half the size of the one before.")
      .def_readwrite("finest_level", &TrackOptions::finest_level, "0: full resolution, four times the work of 1.")
      .def_readwrite("iterations_finest", &TrackOptions::iterations_finest, "At most, on the finest level.")
      .def_readwrite("iterations_coarse", &TrackOptions::iterations_coarse, "At most, per level.")
      .def_readwrite("max_distance", &TrackOptions::max_distance, "Metres between matched points at the finest level.")
      .def_readwrite("max_angle", &TrackOptions::max_angle, "Radians between matched normals.")
      .def_readwrite("photometric", &TrackOptions::photometric, "Aligns brightness too, where there is color.")
      .def_readwrite("huber", &TrackOptions::huber, "In standard deviations of the depth noise.")
      .def_readwrite("min_inlier_share", &TrackOptions::min_inlier_share,
                     "Of the pixels that see the map; fewer means lost.")
      .def_readwrite("max_rmse", &TrackOptions::max_rmse,
                     "In standard deviations of the depth noise; more means lost.");
  py::class_<MotionOptions>(m, "MotionOptions", "How fast the camera may move.")
      .def_readwrite("max_speed", &MotionOptions::max_speed, "m/s.")
      .def_readwrite("max_turn", &MotionOptions::max_turn, "rad/s.");
  py::class_<FuseOptions>(m, "FuseOptions", "How frames are fused into voxels.")
      .def_readwrite("voxel_size", &FuseOptions::voxel_size, "Metres.")
      .def_readwrite("truncation", &FuseOptions::truncation, "Metres, on each side of the surface.")
      .def_readwrite("max_weight", &FuseOptions::max_weight, "Observations at 1 m; lower forgets sooner.")
      .def_readwrite("min_mesh_weight", &FuseOptions::min_mesh_weight, "Voxels below it make no surface.")
      .def_readwrite("device_memory", &FuseOptions::device_memory,
                     "Bytes; 0: half of what the device has, 2 GiB at most.");
  py::class_<MapOptions>(m, "MapOptions", "Submaps and loops.")
      .def_readwrite("submap_radius", &MapOptions::submap_radius, "Metres from where a submap began.")
      .def_readwrite("submap_bricks", &MapOptions::submap_bricks, "That end a submap.")
      .def_readwrite("submap_keyframes", &MapOptions::submap_keyframes, "That end a submap.")
      .def_readwrite("loops", &MapOptions::loops, "Recognise places and correct the map.")
      .def_readwrite("lost_frames", &MapOptions::lost_frames,
                     "In a row, after which the camera begins a new piece of the map.")
      .def_readwrite("host_memory", &MapOptions::host_memory,
                     "Bytes for ended submaps, others wait on the disk; 0: 64 MiB.");
  py::class_<EsdfOptions>(m, "DistanceOptions", "The distance field.")
      .def_readwrite("live", &EsdfOptions::live,
                     "Keeps the field up to date while frames are fused (Mapper.live_distances).")
      .def_readwrite("voxel_size", &EsdfOptions::voxel_size, "Metres: 1, 2, 4 or 8 voxels of the map; 0: two.")
      .def_readwrite("max_distance", &EsdfOptions::max_distance, "Metres.")
      .def_readwrite("robot_radius", &EsdfOptions::robot_radius,
                     "Metres around the camera that are free wherever it was.");
}

}  // namespace

void add_options(py::module_& m) {
  add_stages(m);
  py::class_<Options>(m, "Options", R"(Options(sensor='structured_light', voxel_size=0.01)
--

All settings of a mapper, those that suit a sensor: its range of depth, and a truncation of four voxels, or more where
the sensor is noisier. Each can be set to another value: options.map.loops = False.

sensor: a SensorModel or its name. voxel_size: metres.)")
      .def(py::init([](const py::object& sensor, float voxel_size) {
             return options_for(py::isinstance<py::str>(sensor) ? sensor_model(sensor.cast<std::string>())
                                                                : sensor.cast<SensorModel>(),
                                voxel_size);
           }),
           py::arg("sensor") = "structured_light", py::arg("voxel_size") = FuseOptions{}.voxel_size,
           R"(__init__(self, sensor='structured_light', voxel_size=0.01)
--

)")
      .def_readwrite("keep_keyframes", &Options::keep_keyframes, "Also with given poses, for textures.")
      .def_property(
          "up", [](const Options& o) { return o.up ? std::optional(std::string(name_of(*o.up))) : std::nullopt; },
          [](Options& o, const std::optional<std::string>& up) {
            o.up.reset();
            if (up) o.up = up_of(*up);
          },
          "What points up where the map is written: 'auto', 'camera', 'x', 'y', 'z', '-x', '-y', '-z', or None.")
      .def_readonly("surface", &Options::surface)
      .def_readonly("track", &Options::track)
      .def_readonly("motion", &Options::motion)
      .def_readonly("fuse", &Options::fuse)
      .def_readonly("map", &Options::map)
      .def_readonly("distances", &Options::esdf)
      .def(
          "read", [](Options& o, const std::filesystem::path& file) { read_options(file, o); }, py::arg("file"),
          R"(read(self, file)
--

Sets what a YAML file names (docs/options.md). Raises Error with file and line for what does not fit.)")
      .def(
          "check", [](const Options& o) { check(o); }, R"(check(self)
--

Raises Error naming the option, its value and the allowed range.)");
}

}  // namespace cairn::python
