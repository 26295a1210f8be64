// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <exception>
#include <stdexcept>
#include <utility>

#include "distances.hpp"
#include "map.hpp"
#include "module.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

Poses poses_of(const std::string& name) {
  if (name == "tracked") return Poses::tracked;
  if (name == "given") return Poses::given;
  throw py::value_error("poses is '" + name + "'; tracked or given is expected");
}

std::shared_ptr<GuardedMapper> make_mapper(const Rig& rig, const std::optional<Options>& given,
                                           std::optional<float> voxel_size, const std::string& poses, int device) {
  const Options options = options_of(rig, given, voxel_size);
  const Poses kind = poses_of(poses);
  const py::gil_scoped_release release;
  return std::make_shared<GuardedMapper>(
      GuardedMapper{nullptr, Mapper(rig, options, kind, device), std::make_shared<Guard>(), options});
}

FrameReport add_frame(GuardedMapper& m, const Frame& frame) {
  FrameReport report = m.guard->change([&] { return m.mapper.add(frame); });
  check_signals();
  return report;
}

/// Copies arrays into the mapper's own memory, unless another thread uses it.
FrameReport add(GuardedMapper& m, const py::object& depth, const py::object& color, const py::object& time,
                const py::object& depth_scale, const py::object& confidence, double color_delay, const py::object& pose,
                const py::object& guess, const py::object& acceleration, const py::object& gyro,
                const py::object& accelerations, bool held_out) {
  if (py::isinstance<SizedFrame>(depth)) {
    const auto frame = depth.cast<std::shared_ptr<SizedFrame>>();
    m.next = frame->frame.index + 1;
    return add_frame(m, frame->frame);
  }
  SizedFrame frame = std::exchange(m.scratch, {});
  fill(frame,
       {depth, color, time, depth_scale, confidence, pose, guess, acceleration, gyro, accelerations, color_delay,
        held_out},
       m.next, &m.mapper.rig());
  ++m.next;
  FrameReport report = add_frame(m, frame.frame);
  m.scratch = std::move(frame);
  return report;
}

py::object map_distances(GuardedMapper& m, const py::object& points, std::optional<float> voxel_size,
                         std::optional<float> max_distance, std::optional<float> robot_radius) {
  return distances(*m.guard, points, distance_options(voxel_size, max_distance, robot_radius, {}), py::none(),
                   [&](const std::optional<EsdfOptions>& options, const Trajectory&) {
                     Map map = m.mapper.map();
                     return options ? map.distances(*options) : map.distances();
                   });
}

/// Calls Python while the library works without the interpreter's lock. Stores exceptions, also of Ctrl-C, and raises
/// them after the library has returned.
class Callback {
 public:
  /// True if no exception was raised and `call` returns true.
  template <class Call>
  bool goes_on(Call&& call) {
    const py::gil_scoped_acquire acquire;
    try {
      check_signals();
      return call();
    } catch (const std::exception&) {
      error_ = std::current_exception();
      return false;
    }
  }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::exception_ptr error_;
};

/// Calls `progress`, if given, with the completed fraction; returning False or raising stops.
std::function<bool(double)> goes_on(Callback& callback, const py::object& progress) {
  return [&](double fraction) {
    return callback.goes_on([&] {
      if (progress.is_none()) return true;
      const py::object result = progress(fraction);
      return result.is_none() || result.cast<bool>();
    });
  };
}

AdjustReport adjust(GuardedMapper& m, const py::object& progress) {
  Callback callback;
  AdjustReport report = m.guard->change([&] { return m.mapper.adjust(goes_on(callback, progress)); });
  callback.rethrow();
  return report;
}

RefineReport refine(GuardedMapper& m, const py::object& progress) {
  Callback callback;
  RefineReport report = m.guard->change([&] { return m.mapper.refine(goes_on(callback, progress)); });
  callback.rethrow();
  return report;
}

void reintegrate(GuardedMapper& m, const py::object& again, const std::optional<DepthCorrection>& correction,
                 const py::object& progress) {
  BorrowedSource source(again, m.mapper.rig());
  Callback callback;
  int reported = 0;  // frames
  const auto goes_on = [&](int frames) {
    return callback.goes_on([&] {
      if (progress.is_none() || frames == reported) return true;
      reported = frames;
      const py::object result = progress(frames);
      return result.is_none() || result.cast<bool>();
    });
  };
  source.run([&] {
    const py::gil_scoped_acquire acquire;  // released by the guard below
    m.guard->change([&] { m.mapper.reintegrate(source.get(), correction.value_or(DepthCorrection{}), goes_on); });
  });
  source.rethrow();
  callback.rethrow();
  check_signals();
}

Quality quality_of(const std::string& name) {
  for (const Quality one : {Quality::fast, Quality::good, Quality::best})
    if (to_string(one) == name) return one;
  throw py::value_error("quality '" + name + "': use fast, good or best");
}

FinishReport finish(GuardedMapper& m, const std::optional<std::string>& quality, bool refine, bool adjust,
                    const py::object& again, bool fuse_held_out, const py::object& progress) {
  Callback callback;
  FinishOptions options = finish_options(quality ? quality_of(*quality) : Quality::fast, nullptr);
  options.refine |= refine, options.adjust |= adjust;
  options.fuses_held_out = fuse_held_out;
  options.progress = [&](FinishStage stage, double fraction) {
    return callback.goes_on([&] {
      if (progress.is_none()) return true;
      const py::object result = progress(std::string(to_string(stage)), fraction);
      return result.is_none() || result.cast<bool>();
    });
  };
  const auto work = [&] { return m.guard->change([&] { return m.mapper.finish(options); }); };
  FinishReport report;
  if (again.is_none()) {
    report = work();
  } else {
    BorrowedSource source(again, m.mapper.rig());
    options.reintegrate = &source.get();
    source.run([&] {
      const py::gil_scoped_acquire acquire;  // released by the mapper's guard
      report = work();
    });
    source.rethrow();
  }
  callback.rethrow();
  check_signals();
  return report;
}

py::object live_distances(const GuardedMapper& m) {
  auto field = m.mapper.live_distances();  // callable from any thread
  return field ? py::cast(Field{std::move(field)}) : py::none();
}

}  // namespace

Options options_of(const Rig& rig, const std::optional<Options>& given, std::optional<float> voxel_size) {
  Options options = given.value_or(options_for(rig.sensor, voxel_size.value_or(FuseOptions{}.voxel_size)));
  if (voxel_size)
    options.fuse.voxel_size = *voxel_size,
    options.fuse.truncation = options_for(rig.sensor, *voxel_size).fuse.truncation;
  return options;
}

void add_mapper(py::module_& m) {
  py::class_<GuardedMapper, std::shared_ptr<GuardedMapper>>(
      m, "Mapper", R"(Mapper(rig, options=None, *, voxel_size=None, poses='tracked', device=-1)
--

Builds a map from a stream of frames. Start here.

    mapper = cairn.Mapper(cairn.Rig.kinect_v1(), voxel_size=0.01)
    for frame in cairn.open("recording"):
        report = mapper.add(frame)
    mapper.map().export("room.glb")

rig: the cameras; Source.rig for a Source. options: Options; default: options for the rig's sensor. voxel_size:
meters, overrides the options. poses: 'tracked' estimates poses by aligning each frame with the map, 'given' uses
Frame.pose. device: index of cairn.devices; -1 chooses. Keeps all data in memory, unless created by a Session. Calls
from several threads wait for each other. Raises Error for cameras or options out of range, and for an unusable
device.)")
      .def(py::init(&make_mapper), py::arg("rig"), py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("poses") = "tracked", py::arg("device") = -1,
           R"(__init__(self, rig, options=None, *, voxel_size=None, poses='tracked', device=-1)
--

)")
      .def(
          "add", &add, py::arg("depth"), py::arg("color") = py::none(), py::kw_only(), py::arg("time") = py::none(),
          py::arg("depth_scale") = py::none(), py::arg("confidence") = py::none(), py::arg("color_delay") = 0.0,
          py::arg("pose") = py::none(), py::arg("guess") = py::none(), py::arg("acceleration") = py::none(),
          py::arg("gyro") = py::none(), py::arg("accelerations") = py::none(), py::arg("held_out") = false,
          R"(add(self, depth, color=None, *, time=None, depth_scale=None, confidence=None, color_delay=0.0, pose=None, guess=None, acceleration=None, gyro=None, accelerations=None, held_out=False)
--

Tracks and fuses the next frame, a Frame or images with their time (see Frame for shapes and units). Returns a
FrameReport, also for bad frames and lost tracking. Raises ValueError or TypeError for images that do not match the
rig, and Error only if the device fails; the map so far remains.)")
      .def(
          "begin_recording", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.begin_recording(); }); },
          R"(begin_recording(self)
--

Starts another recording, at any place inside or outside the map. Its frames are lost until relocalized; after a while
without relocalization they start a new component.)")
      .def(
          "finish", &finish, py::kw_only(), py::arg("quality") = py::none(), py::arg("refine") = false,
          py::arg("adjust") = false, py::arg("reintegrate") = py::none(), py::arg("fuse_held_out") = false,
          py::arg("progress") = py::none(),
          R"(finish(self, *, quality=None, refine=False, adjust=False, reintegrate=None, fuse_held_out=False, progress=None)
--

Finishes the map after the last frame: runs the requested stages, applies all pending loop closures and freezes the
gravity direction. Returns a FinishReport. quality: 'good' or 'best', as `cairn reconstruct --quality`: adjust, then
reintegrate; the result is kept if held-out frames (Frame.held_out) confirm it. refine, adjust: as the methods of the
same name. reintegrate: the same recording from its start, with the same frames held out, a Source or an iterable of
Frames, for the method of the same name after adjust. fuse_held_out: fuses the held-out frames in the end.
progress: called with the stage ('refine', 'adjust', 'reintegrate') and its completed fraction, 0 while unknown; if it
returns False or raises, or on Ctrl-C, the stage ends as its method does, and the following stages are skipped.)")
      .def(
          "finish_optimization", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.finish_optimization(); }); },
          R"(finish_optimization(self)
--

Applies all pending loop closures to the keyframe poses. Call it before trajectory() if no frame follows.)")
      .def(
          "freeze_gravity", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.freeze_gravity(); }); },
          R"(freeze_gravity(self)
--

Freezes the gravity direction; later recordings do not change it.)")
      .def("refine", &refine, py::kw_only(), py::arg("progress") = py::none(), R"(refine(self, *, progress=None)
--

Aligns covisible keyframes with each other and corrects the poses. Returns a RefineReport. progress: called with the
completed fraction; if it returns False or raises, or on Ctrl-C, the poses stay unchanged, and a warning gives the
reason.)")
      .def("adjust", &adjust, py::kw_only(), py::arg("progress") = py::none(), R"(adjust(self, *, progress=None)
--

Bundle adjustment: optimizes all keyframe poses jointly for depth and brightness consistency, with the shutter readout
and the depth correction; the map follows by moving the submaps. Returns an AdjustReport. Close all loops before:
refine. progress: called with the completed fraction; if it returns False or raises, or on Ctrl-C, the result so far
is kept. If the adjustment fails, the poses stay unchanged, and a warning gives the reason.)")
      .def("reintegrate", &reintegrate, py::arg("frames"), py::arg("correction") = std::nullopt, py::kw_only(),
           py::arg("progress") = py::none(), R"(reintegrate(self, frames, correction=None, *, progress=None)
--

Re-integrates all frames instead of deforming submaps: keyframes at their current poses, then the frames between them,
each tracked again. frames: the same recording from its start, with the same frames held out: a Source or an iterable
of Frames. correction: applied to depth from here on, in addition to the rig's: AdjustReport.correction. progress:
called with the number of frames so far. If it returns False or raises, or on a failure or Ctrl-C, the map stays
unchanged, and a warning gives the reason.)")
      .def(
          "map",
          [](GuardedMapper& s) {
            return GuardedMap{s.guard->run([&] { return s.mapper.map(); }), s.guard};
          },
          R"(map(self)
--

A view of the current map; each call reads the latest state.)")
      .def(
          "mesh", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.map().mesh(); }); }, R"(mesh(self)
--

Surface by marching cubes, with normals and colors, as a Mesh.)")
      .def("distances", &map_distances, py::arg("points") = py::none(), py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("max_distance") = std::nullopt,
           py::arg("robot_radius") = std::nullopt,
           R"(distances(self, points=None, *, voxel_size=None, max_distance=None, robot_radius=None)
--

Distance field of the entire map, as a DistanceField in the world of mesh(); with points (..., 3) the result of
DistanceField.query: (distances, gradients, known). Computed at the first call after a frame was added; live_distances
is available at once.)")
      .def("live_distances", &live_distances, R"(live_distances(self)
--

With Options.distances.live: distance field as of the last frame, as a DistanceField in the tracking frame, the frame
of FrameReport.pose. None before the first frame, and after a failure. Does not wait for other calls.)")
      .def(
          "trajectory",
          [](GuardedMapper& s, int recording) {
            return StampedPoses{s.guard->run([&] { return s.mapper.trajectory(recording); })};
          },
          py::arg("recording") = -1, R"(trajectory(self, recording=-1)
--

Poses of all fused or held-out frames, in the gravity-aligned world and the color camera's clock, as a Trajectory.
recording: counted from 0; -1: the last.)")
      .def_property_readonly("recordings",
                             [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.recordings(); }); })
      .def(
          "keyframes",
          [](GuardedMapper& s) {
            std::vector<std::pair<double, int>> keyframes;
            for (const auto& [timestamp, searched] : s.guard->run([&] { return s.mapper.keyframes(); }))
              keyframes.emplace_back(timestamp, searched);
            return keyframes;
          },
          R"(keyframes(self)
--

A list of (time, count): timestamps of the keyframes, each with the number of earlier keyframes searched for a loop
closure.)")
      .def(
          "loops", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.loops(); }); }, R"(loops(self)
--

Loop closures found while adding frames, a list of Loop.)")
      .def(
          "upright", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.upright(); }); }, R"(upright(self)
--

Gravity alignment of the map, as GravityAlignment.)")
      .def(
          "statistics", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.statistics(); }); },
          R"(statistics(self)
--

Size and cost of the map, and estimates about the camera, as Statistics.)")
      .def(
          "warnings", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.warnings(); }); },
          R"(warnings(self)
--

Optional stages switched off after a failure, one line each.)")
      .def_property_readonly(
          "rig", [](const GuardedMapper& s) { return s.mapper.rig(); }, "The cameras.")
      .def("__repr__", [](const GuardedMapper& s) {
        return repr("Mapper", {{"rig", s.mapper.rig()}});
      });
}

}  // namespace cairn::python
