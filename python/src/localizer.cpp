// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/localizer.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <memory>
#include <optional>
#include <tuple>
#include <utility>

#include "frames.hpp"
#include "module.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

/// Localizer for use by several threads; calls are serialized.
struct GuardedLocalizer {
  Localizer localizer;
  Rig rig;
  std::unique_ptr<Guard> guard = std::make_unique<Guard>();
  SizedFrame scratch{};  // for arrays; its memory is reused
  int next = 0;          // index of the next frame
};

std::unique_ptr<GuardedLocalizer> make_localizer(const std::filesystem::path& map, const Rig& rig,
                                                 const std::optional<Options>& options, bool changes, int device) {
  const Options given = options.value_or(Options{});
  const py::gil_scoped_release release;
  return std::make_unique<GuardedLocalizer>(GuardedLocalizer{
      Localizer(map, rig, {.track = given.track, .motion = given.motion, .changes = changes}, device), rig});
}

LocalizedFrame add_frame(GuardedLocalizer& l, const Frame& frame) {
  LocalizedFrame localized = l.guard->run([&] { return l.localizer.add(frame); });
  check_signals();
  return localized;
}

LocalizedFrame add(GuardedLocalizer& l, const py::object& depth, const py::object& color, const py::object& time,
                   const py::object& depth_scale, const py::object& confidence, double color_delay,
                   const py::object& guess, const py::object& acceleration, const py::object& gyro,
                   const py::object& accelerations) {
  if (py::isinstance<SizedFrame>(depth)) {
    const auto frame = depth.cast<std::shared_ptr<SizedFrame>>();
    l.next = frame->frame.index + 1;
    return add_frame(l, frame->frame);
  }
  SizedFrame frame = std::exchange(l.scratch, {});
  fill(frame,
       {depth, color, time, depth_scale, confidence, py::none(), guess, acceleration, gyro, accelerations, color_delay,
        false},
       l.next, &l.rig);
  ++l.next;
  LocalizedFrame localized = add_frame(l, frame.frame);
  l.scratch = std::move(frame);
  return localized;
}

void add_localized_frame(py::module_& m) {
  py::class_<LocalizedFrame>(m, "LocalizedFrame", "Pose of a frame in a map.")
      .def_readonly("index", &LocalizedFrame::index)
      .def_readonly("time", &LocalizedFrame::timestamp, "Seconds, of the depth image.")
      .def_property_readonly(
          "pose", [](const LocalizedFrame& f) { return to_numpy(f.world_from_camera); },
          "(4, 4) float64, meters: pose of the depth camera in the exported world of the map, the frame of "
          "Map.trajectory. None if no pose was confirmed by the map's surface.")
      .def_property_readonly(
          "covariance",
          [](const LocalizedFrame& f) -> py::object {
            return f.covariance ? py::object(to_numpy(*f.covariance)) : py::none();
          },
          "(6, 6) float64 of (rotation, translation) in the camera's frame, rad^2 and m^2: covariance of the pose "
          "relative to the map. None without a pose.")
      .def_readonly("reason", &LocalizedFrame::reason, "Reason for a missing pose, with the measured value.")
      .def_readonly("fit", &LocalizedFrame::fit)
      .def_property_readonly(
          "guess", [](const LocalizedFrame& f) { return std::string(to_string(f.guess)); },
          "Initial guess of the alignment: motion, still, features, relocalized (found by place recognition).")
      .def_readonly("milliseconds", &LocalizedFrame::milliseconds, "Time of the call.")
      .def("__repr__", [](const LocalizedFrame& f) {
        return repr("LocalizedFrame",
                    {{"index", f.index}, {"found", f.world_from_camera.has_value()}, {"reason", f.reason}});
      });
}

}  // namespace

void add_localizer(py::module_& m) {
  add_localized_frame(m);
  py::class_<GuardedLocalizer>(m, "Localizer", R"(Localizer(map, rig, options=None, *, changes=False, device=-1)
--

Localizes frames in the map of a saved session, which stays unchanged: place recognition finds the first pose and poses
after a tracking loss, then each frame is aligned with the map's surface.

    source = cairn.open("tuesday")
    localizer = cairn.Localizer("out", source.rig)
    for frame in source:
        pose = localizer.add(frame).pose      # in the frame of out/trajectory.txt; None: not found

map: folder of `cairn reconstruct`, `live` or `merge`, as of its last checkpoint. rig: of the frames; the cameras may
differ from the map's. options: track and motion are used. changes: fuses the localized frames for export_changes.
Raises Error for a missing or damaged session.)")
      .def(py::init(&make_localizer), py::arg("map"), py::arg("rig"), py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("changes") = false, py::arg("device") = -1,
           R"(__init__(self, map, rig, options=None, *, changes=False, device=-1)
--

)")
      .def(
          "add", &add, py::arg("depth"), py::arg("color") = py::none(), py::kw_only(), py::arg("time") = py::none(),
          py::arg("depth_scale") = py::none(), py::arg("confidence") = py::none(), py::arg("color_delay") = 0.0,
          py::arg("guess") = py::none(), py::arg("acceleration") = py::none(), py::arg("gyro") = py::none(),
          py::arg("accelerations") = py::none(),
          R"(add(self, depth, color=None, *, time=None, depth_scale=None, confidence=None, color_delay=0.0, guess=None, acceleration=None, gyro=None, accelerations=None)
--

Localizes the next frame, a Frame or images with their time (see Frame for shapes and units). Returns a LocalizedFrame.
Raises ValueError or TypeError for images that do not match the rig, and Error only if the device fails.)")
      .def(
          "begin_recording", [](GuardedLocalizer& l) { l.guard->run([&] { l.localizer.begin_recording(); }); },
          R"(begin_recording(self)
--

Starts another recording: its first frame may be anywhere in the map, at any time.)")
      .def(
          "export_changes",
          [](GuardedLocalizer& l, const std::filesystem::path& file, float distance, float min_area) {
            const ExportedChange changes = l.guard->run(
                [&] { return l.localizer.export_changes(file, {.distance = distance, .min_area = min_area}); });
            std::vector<std::tuple<std::string, double, Doubles>> regions;
            for (const ChangedRegion& region : changes.regions)
              regions.emplace_back(region.is_new ? "new" : "gone", region.area, to_numpy(region.middle));
            return regions;
          },
          py::arg("file"), py::kw_only(), py::arg("distance") = 0.0f, py::arg("min_area") = 0.03f,
          R"(export_changes(self, file, *, distance=0.0, min_area=0.03)
--

With changes=True: writes the seen surface as .glb or .gltf, surface new since the map in blue and gone surface in
orange. distance: meters of distance up to which a surface counts as unchanged; 0: four voxels. min_area: m2; smaller
changes are ignored. Returns the changed regions, largest first: a list of ('new' or 'gone', area in m2, center (3,) in
the exported world).)")
      .def(
          "upright", [](GuardedLocalizer& l) { return l.guard->run([&] { return l.localizer.upright(); }); },
          R"(upright(self)
--

Gravity alignment of the map, as GravityAlignment.)")
      .def(
          "warnings", [](GuardedLocalizer& l) { return l.guard->run([&] { return l.localizer.warnings(); }); },
          R"(warnings(self)
--

Parts of the map that could not be loaded, one line each.)")
      .def_property_readonly(
          "rig", [](const GuardedLocalizer& l) { return l.rig; }, "The cameras of the frames.")
      .def("__repr__", [](const GuardedLocalizer& l) {
        return repr("Localizer", {{"rig", l.rig}});
      });
}

}  // namespace cairn::python
