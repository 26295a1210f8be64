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
      GuardedMapper{nullptr, Mapper(rig, options, kind, device), std::make_shared<Guard>()});
}

FrameReport add_frame(GuardedMapper& m, const Frame& frame) {
  FrameReport report = m.guard->change([&] { return m.mapper.add(frame); });
  check_signals();
  return report;
}

/// Copies arrays into the mapper's own memory, unless another thread uses it.
FrameReport add(GuardedMapper& m, const py::object& depth, const py::object& colour, const py::object& time,
                const py::object& depth_scale, const py::object& confidence, double colour_delay,
                const py::object& pose, const py::object& guess, const py::object& acceleration, const py::object& gyro,
                bool held_out) {
  if (py::isinstance<SizedFrame>(depth)) {
    const auto frame = depth.cast<std::shared_ptr<SizedFrame>>();
    m.next = frame->frame.index + 1;
    return add_frame(m, frame->frame);
  }
  SizedFrame frame = std::exchange(m.scratch, {});
  fill(frame, {depth, colour, time, depth_scale, confidence, pose, guess, acceleration, gyro, colour_delay, held_out},
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

/// Asks `progress`, if given, whether to continue; returning False or raising stops.
std::function<bool(double)> goes_on(Callback& callback, const py::object& progress) {
  return [&](double share) {
    return callback.goes_on([&] {
      if (progress.is_none()) return true;
      const py::object said = progress(share);
      return said.is_none() || said.cast<bool>();
    });
  };
}

Adjusted adjust(GuardedMapper& m, const py::object& progress) {
  Callback callback;
  Adjusted adjusted = m.guard->change([&] { return m.mapper.adjust(goes_on(callback, progress)); });
  callback.rethrow();
  return adjusted;
}

Refined refine(GuardedMapper& m, const py::object& progress) {
  Callback callback;
  Refined refined = m.guard->change([&] { return m.mapper.refine(goes_on(callback, progress)); });
  callback.rethrow();
  return refined;
}

void reintegrate(GuardedMapper& m, const py::object& again, const std::optional<DepthCorrection>& correction,
                 const py::object& progress) {
  BorrowedSource source(again, m.mapper.rig());
  Callback callback;
  int told = 0;
  const auto goes_on = [&](int frames) {
    return callback.goes_on([&] {
      if (progress.is_none() || frames == told) return true;
      told = frames;
      const py::object said = progress(frames);
      return said.is_none() || said.cast<bool>();
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

From a stream of frames to a map: start here.

    mapper = cairn.Mapper(cairn.Rig.kinect_v1(), voxel_size=0.01)
    for frame in cairn.open("recording"):
        report = mapper.add(frame)
    mapper.map().export("room.glb")

rig: the cameras, of a Source its rig. options: Options; without them what suits the rig's sensor. voxel_size: metres, in
place of the options'. poses: 'tracked' finds them by aligning each frame with the map, 'given' takes Frame.pose. device:
as cairn.devices numbers them; -1 chooses. All stays in memory; with a Session it does not. Calls of several threads wait
for each other. Raises Error for cameras or options out of range, and for a device that cannot be used.)")
      .def(py::init(&make_mapper), py::arg("rig"), py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("poses") = "tracked", py::arg("device") = -1,
           R"(__init__(self, rig, options=None, *, voxel_size=None, poses='tracked', device=-1)
--

)")
      .def(
          "add", &add, py::arg("depth"), py::arg("color") = py::none(), py::kw_only(), py::arg("time") = py::none(),
          py::arg("depth_scale") = py::none(), py::arg("confidence") = py::none(), py::arg("color_delay") = 0.0,
          py::arg("pose") = py::none(), py::arg("guess") = py::none(), py::arg("acceleration") = py::none(),
          py::arg("gyro") = py::none(), py::arg("held_out") = false,
          R"(add(self, depth, color=None, *, time=None, depth_scale=None, confidence=None, color_delay=0.0, pose=None, guess=None, acceleration=None, gyro=None, held_out=False)
--

Aligns and fuses the next frame, a Frame or own images with their time (see Frame for shapes and units); tells in a
FrameReport what became of it. Lost tracking is told there, too. Raises ValueError and TypeError for images that are not
the rig's, and Error only when the device fails; what was fused before stays.)")
      .def(
          "begin_recording", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.begin_recording(); }); },
          R"(begin_recording(self)
--

Another recording follows, which begins somewhere in the map or outside of it.)")
      .def(
          "settle", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.settle(); }); }, R"(settle(self)
--

Moves the keyframes as all loops so far say: before trajectory() when no frame follows.)")
      .def(
          "settle_upright", [](GuardedMapper& s) { s.guard->change([&] { s.mapper.settle_upright(); }); },
          R"(settle_upright(self)
--

From now on the map stands as it is known now.)")
      .def("refine", &refine, py::kw_only(), py::arg("progress") = py::none(), R"(refine(self, *, progress=None)
--

Aligns keyframes that see the same with each other and corrects the poses; tells in Refined what it did. progress: called
with the share that is done; when it returns False, or raises, or Ctrl-C is pressed, the poses stay as they are, and a
warning tells why.)")
      .def("adjust", &adjust, py::kw_only(), py::arg("progress") = py::none(), R"(adjust(self, *, progress=None)
--

Moves the keyframes to where depth and brightness of all that they see agree best, all together (bundle adjustment);
the map follows by moving the submaps. Tells in Adjusted what it did, and what it learned of shutters and depth. Loops
must be closed before: refine. progress: called with the share that is done; when it returns False, or raises, or Ctrl-C
is pressed, what is adjusted so far is kept. When it fails the poses stay as they are, and a warning tells why.)")
      .def("reintegrate", &reintegrate, py::arg("frames"), py::arg("correction") = std::nullopt, py::kw_only(),
           py::arg("progress") = py::none(), R"(reintegrate(self, frames, correction=None, *, progress=None)
--

Fuses all frames again instead of bending submaps: the keyframes where they are now, then those between them, each
tracked anew. frames: the same recording from its begin, with the same frames held out, a Source or anything that gives
Frames. correction: of depth from here on, beside what the rig says: Adjusted.correction. progress: called with the
number of frames so far. When it returns False, raises or fails, or Ctrl-C ends it, the map stays as it is, and a warning
tells why.)")
      .def(
          "map",
          [](GuardedMapper& s) {
            return GuardedMap{s.guard->run([&] { return s.mapper.map(); }), s.guard};
          },
          R"(map(self)
--

The map as it is now, and always as it is when it is asked.)")
      .def(
          "mesh", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.map().mesh(); }); }, R"(mesh(self)
--

The surface as it is in the voxels (marching cubes), with normals and colors, as a Mesh.)")
      .def("distances", &map_distances, py::arg("points") = py::none(), py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("max_distance") = std::nullopt,
           py::arg("robot_radius") = std::nullopt,
           R"(distances(self, points=None, *, voxel_size=None, max_distance=None, robot_radius=None)
--

The distance field of the whole map, a DistanceField in the world of mesh(); with points (..., 3) its answers there:
(distances, gradients, known), as DistanceField.query. It is made at the first call after a frame was added; while
frames come quickly, live_distances is there at once.)")
      .def("live_distances", &live_distances, R"(live_distances(self)
--

With Options.distances.live the field as of the last frame, a DistanceField in the frame in which the camera is tracked,
that of FrameReport.pose. None before the first frame, and where it cannot be made. Waits for nobody.)")
      .def(
          "trajectory",
          [](GuardedMapper& s, int recording) {
            return StampedPoses{s.guard->run([&] { return s.mapper.trajectory(recording); })};
          },
          py::arg("recording") = -1, R"(trajectory(self, recording=-1)
--

Of all frames that were fused or held out as a Trajectory, in the upright world and the color camera's clock; recording counts from 0, -1 is
the last.)")
      .def_property_readonly("recordings",
                             [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.recordings(); }); })
      .def(
          "keyframes", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.keyframes(); }); },
          R"(keyframes(self)
--

A list of (time, count): when the keyframes were taken and how many earlier ones were looked through for their places.)")
      .def(
          "loops", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.loops(); }); }, R"(loops(self)
--

Loops that were found, a list of Loop.)")
      .def(
          "upright", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.upright(); }); }, R"(upright(self)
--

Which way up the map stands, as Upright.)")
      .def(
          "statistics", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.statistics(); }); },
          R"(statistics(self)
--

How large the map is, what it cost, and what was learned of the camera, as Statistics.)")
      .def(
          "warnings", [](GuardedMapper& s) { return s.guard->run([&] { return s.mapper.warnings(); }); },
          R"(warnings(self)
--

Stages that failed and were switched off, a line each.)")
      .def_property_readonly(
          "rig", [](const GuardedMapper& s) { return s.mapper.rig(); }, "The cameras.")
      .def("__repr__", [](const GuardedMapper& s) {
        return repr("Mapper", {{"rig", s.mapper.rig()}});
      });
}

}  // namespace cairn::python
