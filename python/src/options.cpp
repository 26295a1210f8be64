// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/options.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "module.hpp"

namespace cairn::python {

namespace py = pybind11;

namespace {

void add_stages(py::module_& m) {
  py::class_<SurfaceOptions>(m, "SurfaceOptions", "Preprocessing of depth images.")
      .def_readwrite("min_depth", &SurfaceOptions::min_depth, "Meters; nearer measurements are dropped.")
      .def_readwrite("max_depth", &SurfaceOptions::max_depth, "Meters; farther measurements are dropped.")
      .def_readwrite("filter_sigma_pixels", &SurfaceOptions::filter_sigma_pixels,
                     "Width of the bilateral filter, pixels.")
      .def_readwrite("filter_range", &SurfaceOptions::filter_range,
                     "Maximum depth difference of a neighbor, in standard deviations of the depth noise.")
      .def_readwrite(
          "edge_slope", &SurfaceOptions::edge_slope,
          "Depth difference to the neighbors on both sides that drops a pixel, in standard deviations of the depth "
          "noise.");
  py::class_<TrackOptions>(m, "TrackOptions", "Alignment of frames with the map.")
      .def_readwrite("levels", &TrackOptions::levels, "Number of pyramid levels, each of half the size.")
      .def_readwrite("finest_level", &TrackOptions::finest_level, "0: full resolution, four times the work of 1.")
      .def_readwrite("iterations_finest", &TrackOptions::iterations_finest, "Maximum number on the finest level.")
      .def_readwrite("iterations_coarse", &TrackOptions::iterations_coarse, "Maximum number on each coarser level.")
      .def_readwrite("max_distance", &TrackOptions::max_distance, "Meters between matched points at the finest level.")
      .def_readwrite("max_angle", &TrackOptions::max_angle, "Radians between matched normals.")
      .def_readwrite("photometric", &TrackOptions::photometric, "Adds brightness residuals if there is color.")
      .def_readwrite("huber", &TrackOptions::huber,
                     "Threshold of the robust weight, in standard deviations of the depth noise.")
      .def_readwrite("min_inlier_share", &TrackOptions::min_inlier_share,
                     "Minimum inlier fraction of the pixels that see the map; below it the frame is lost.")
      .def_readwrite("max_rmse", &TrackOptions::max_rmse,
                     "Maximum RMSE, in standard deviations of the depth noise; above it the frame is lost.")
      .def_property(
          "device_poses", [](const TrackOptions& o) { return std::string(to_string(o.device_poses)); },
          [](TrackOptions& o, const std::string& name) { o.device_poses = device_poses_of(name); },
          "Use of Frame.guess: off, guess (start of the alignment) or prior (also a measurement of the motion).");
  py::class_<MotionOptions>(m, "MotionOptions", "Speed limits of the camera.")
      .def_readwrite("max_speed", &MotionOptions::max_speed, "m/s.")
      .def_readwrite("max_turn", &MotionOptions::max_turn, "rad/s.");
  py::class_<FuseOptions>(m, "FuseOptions", "Integration of frames into voxels.")
      .def_readwrite("voxel_size", &FuseOptions::voxel_size, "Meters.")
      .def_readwrite("truncation", &FuseOptions::truncation, "Meters, on each side of the surface.")
      .def_readwrite("max_weight", &FuseOptions::max_weight, "Observations at 1 m; lower forgets sooner.")
      .def_readwrite("min_mesh_weight", &FuseOptions::min_mesh_weight, "Minimum weight of a voxel with surface.")
      .def_readwrite("device_memory", &FuseOptions::device_memory,
                     "Bytes; 0: half of the device memory, at most 2 GiB.");
  py::class_<MapOptions>(m, "MapOptions", "Submaps and loop closures.")
      .def_readwrite("submap_radius", &MapOptions::submap_radius,
                     "Meters from the start of a submap; the camera ends it beyond.")
      .def_readwrite("submap_bricks", &MapOptions::submap_bricks, "Maximum number of bricks of a submap.")
      .def_readwrite("submap_keyframes", &MapOptions::submap_keyframes, "Maximum number of keyframes of a submap.")
      .def_readwrite("loops", &MapOptions::loops, "Closes loops and corrects the map.")
      .def_readwrite("lost_frames", &MapOptions::lost_frames,
                     "Number of consecutive lost frames before a new component of the map.")
      .def_readwrite("host_memory", &MapOptions::host_memory,
                     "Bytes for ended submaps, the rest is paged to disk; 0: 16 MiB.");
  py::class_<EsdfOptions>(m, "EsdfOptions", "Distance field.")
      .def_readwrite("live", &EsdfOptions::live, "Updates the field with each frame (Mapper.live_distances).")
      .def_readwrite("voxel_size", &EsdfOptions::voxel_size, "Meters: 1, 2, 4 or 8 voxels of the map; 0: two.")
      .def_readwrite("max_distance", &EsdfOptions::max_distance, "Meters.")
      .def_readwrite("robot_radius", &EsdfOptions::robot_radius, "Meters of free space around each camera position.");
}

}  // namespace

void add_options(py::module_& m) {
  add_stages(m);
  py::class_<Options>(m, "Options", R"(Options(sensor='structured_light', voxel_size=0.01)
--

All settings of a mapper, with defaults for a sensor: its depth range, and a truncation of four voxels, or more for a
noisier sensor. All are writable: options.map.loops = False.

sensor: a SensorModel or its name. voxel_size: meters.)")
      .def(py::init([](const py::object& sensor, float voxel_size) {
             return options_for(py::isinstance<py::str>(sensor) ? sensor_model(sensor.cast<std::string>())
                                                                : sensor.cast<SensorModel>(),
                                voxel_size);
           }),
           py::arg("sensor") = "structured_light", py::arg("voxel_size") = FuseOptions{}.voxel_size,
           R"(__init__(self, sensor='structured_light', voxel_size=0.01)
--

)")
      .def_readwrite("keep_keyframes", &Options::keep_keyframes,
                     "Stores keyframes also with given poses, for textures.")
      .def_property(
          "up", [](const Options& o) { return o.up ? std::optional(std::string(to_string(*o.up))) : std::nullopt; },
          [](Options& o, const std::optional<std::string>& up) {
            o.up.reset();
            if (up) o.up = parse_up(*up);
          },
          "Up direction of the output: 'auto', 'camera', 'x', 'y', 'z', '-x', '-y', '-z', or None.")
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

Sets the options given in a YAML file (docs/options.md). Raises Error with file and line for an invalid entry.)")
      .def(
          "check", [](const Options& o) { check(o); }, R"(check(self)
--

Raises Error with the option, its value and the allowed range.)");
}

}  // namespace cairn::python
