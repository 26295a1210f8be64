// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>
#include <exception>
#include <utility>

#include "cairn/io/inspect.hpp"
#include "cairn/io/layouts.hpp"
#include "cairn/io/live_source.hpp"
#include "cairn/io/mask.hpp"
#include "cairn/io/recorder.hpp"
#include "frames.hpp"
#include "module.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

constexpr std::chrono::milliseconds kSignalInterval{100};  // interval of checks for Ctrl-C

SizedFrame sized(Frame&& frame, const Rig& rig) {
  const auto size_of = [](const Camera& c, std::size_t pixels) -> std::array<py::ssize_t, 2> {
    if (pixels != static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height)) return {0, 0};
    return {c.height, c.width};
  };
  SizedFrame result{std::move(frame), {}, {}};
  result.depth_size = size_of(rig.depth, result.frame.depth.size());
  result.color_size = size_of(rig.color_view(), result.frame.color.size());
  return result;
}

/// Source of frames from a Python iterable.
class IteratedSource final : public Source {
 public:
  IteratedSource(const py::object& frames, const Rig& rig) : frames_(py::iter(frames)), rig_(rig) {}
  const Rig& rig() const override { return rig_; }
  std::optional<int> size() const override { return std::nullopt; }
  std::optional<Frame> next() override {
    const py::gil_scoped_acquire acquire;
    try {
      return read();
    } catch (const std::exception&) {
      error = std::current_exception();  // the caller may replace it with its own exception
      throw;
    }
  }

  std::exception_ptr error;

 private:
  std::optional<Frame> read() {
    check_signals();
    if (frames_ == py::iterator::sentinel()) return std::nullopt;
    const py::object item = py::reinterpret_borrow<py::object>(*frames_);
    if (!py::isinstance<SizedFrame>(item)) throw py::type_error("a Frame is expected, not " + description_of(item));
    Frame frame = item.cast<const SizedFrame&>().frame;
    ++frames_;
    return frame;
  }

  py::iterator frames_;
  Rig rig_;
};

FrameRange range_of(const py::object& frames) {
  if (frames.is_none()) return {};
  if (py::isinstance<py::int_>(frames)) return {.begin = 0, .end = frames.cast<int>()};
  if (py::isinstance<py::slice>(frames)) {
    const auto part = [&](const char* name) { return frames.attr(name).cast<std::optional<int>>(); };
    const FrameRange range{part("start").value_or(0), part("stop"), part("step").value_or(1)};
    if (range.begin >= 0 && range.end.value_or(0) >= 0 && range.step > 0) return range;
    throw py::value_error("frames is " + std::string(py::str(frames)) + "; frames count from 0, with a positive step");
  }
  throw py::type_error("frames is " + description_of(frames) +
                       "; a number of frames or slice(begin, end, step) is expected");
}

std::optional<Trajectory> poses_of(const py::object& poses) {
  if (poses.is_none()) return std::nullopt;
  if (py::isinstance<StampedPoses>(poses)) return poses.cast<const StampedPoses&>().poses;
  return read_trajectory(poses.cast<std::filesystem::path>());
}

GuardedSource open_named(const std::filesystem::path& name, const py::object& frames,
                         const std::optional<std::filesystem::path>& camera, const std::optional<std::string>& sensor,
                         const std::string& depth_topic, const std::string& color_topic, const py::object& poses,
                         const py::object& guesses, bool color_on_depth, int ahead, bool live, std::optional<int> every,
                         const std::optional<std::filesystem::path>& masks) {
  SourceOptions options{.range = range_of(frames),
                        .camera = camera.value_or(std::filesystem::path{}),
                        .sensor = {},
                        .copy_to = {},
                        .depth_topic = depth_topic,
                        .color_topic = color_topic};
  if (sensor) options.sensor = sensor_model(*sensor);
  auto given = poses_of(poses), guessed = poses_of(guesses);
  const bool waits = !live && !is_sensor(name.string());
  const py::gil_scoped_release release;
  auto source = hold_out(open_source(name.string(), options), {.every = every.value_or(0), .range = options.range});
  if (masks) source = with_masks(std::move(source), *masks, name.string());
  if (given) source = with_poses(std::move(source), std::move(*given));
  if (guessed) source = with_guesses(std::move(source), std::move(*guessed));
  if (color_on_depth) source = with_color_on_depth(std::move(source));
  if (waits && ahead > 0) source = read_ahead(std::move(source), ahead);
  if (live)
    source = std::make_unique<LiveSource>(std::move(source),
                                          is_sensor(name.string()) ? Pace::as_it_comes : Pace::as_recorded);
  const std::optional<int> size = source->size();
  return {std::move(source), std::make_unique<Guard>(), live, size};
}

void add_source(py::module_& m) {
  py::class_<GuardedSource>(m, "Source", R"(A stream of frames, read in order: for frame in cairn.open("recording").)")
      .def_property_readonly(
          "rig", [](const GuardedSource& s) { return s.source->rig(); }, "The cameras.")
      .def_property_readonly(
          "layout", [](const GuardedSource& s) { return s.source->layout(); }, "Kind of input, in a few words.")
      .def_readonly("size", &GuardedSource::size, "Number of frames, or None if unknown.")
      .def_property_readonly(
          "ended_early", [](GuardedSource& s) { return s.guard->run([&] { return s.source->ended_early(); }); },
          "Reason for a premature end of the stream, or None.")
      .def_property_readonly(
          "dropped", [](GuardedSource& s) { return s.guard->run([&] { return s.source->dropped(); }); },
          "Number of frames dropped because the reader was slower than the stream.")
      .def("read", &GuardedSource::next, R"(read(self)
--

The next frame, or None at the end of the stream. An unreadable frame has its problem set.)")
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__",
           [](GuardedSource& s) {
             auto frame = s.next();
             if (!frame) throw py::stop_iteration();
             return std::move(*frame);
           })
      .def("__repr__", [](const GuardedSource& s) { return "Source of a " + s.source->layout(); });

  m.def(
      "open", &open_named, py::arg("name"), py::kw_only(), py::arg("frames") = py::none(),
      py::arg("camera") = std::nullopt, py::arg("sensor") = std::nullopt, py::arg("depth_topic") = "",
      py::arg("color_topic") = "", py::arg("poses") = py::none(), py::arg("guesses") = py::none(),
      py::arg("color_on_depth") = false, py::arg("read_ahead") = 4, py::arg("live") = false,
      py::arg("hold_out") = std::nullopt, py::arg("masks") = std::nullopt,
      R"(open(name, *, frames=None, camera=None, sensor=None, depth_topic='', color_topic='', poses=None, guesses=None, color_on_depth=False, read_ahead=4, live=False, hold_out=None, masks=None)
--

Opens a recording, a sensor or a scene as a Source.

name: a folder or file of a known layout (docs/inputs.md), 'openni:', 'realsense:' or 'k4a:' for the first sensor,
'tcp:PORT' or 'ws:PORT' for frames of a client, 'synthetic:room' for a rendered scene. frames: number of frames, or slice(begin, end, step). camera: a camera.yaml or
the name of a known camera, overrides the recording's. sensor: name of a SensorModel. depth_topic, color_topic: topics
of a ROS recording.
poses, guesses: a Trajectory or its file, for Frame.pose and Frame.guess. color_on_depth: reprojects color to the
depth camera. read_ahead: number of frames decoded ahead in a thread. live: only the newest frame; a recording is
played in real time. hold_out: marks every n-th frame as held out for evaluation (Frame.held_out); 2 or more. masks:
folder of PNG images named by the depth image's number or time, as `cairn reconstruct --mask`. Raises Error with the
cause, the place and the remedy.)");

  m.def(
      "recorded_truth",
      [](const std::filesystem::path& recording) {
        const py::gil_scoped_release release;
        return StampedPoses{recorded_truth(recording)};
      },
      py::arg("recording"), R"(recorded_truth(recording)
--

Ground-truth poses of a recording (groundtruth.txt and similar), as a Trajectory; empty if it has none.)");
}

void add_inspection(py::module_& m) {
  py::class_<SourceSummary>(m, "SourceSummary", "Contents of a recording: result of inspect.")
      .def_readonly("layout", &SourceSummary::layout)
      .def_readonly("rig", &SourceSummary::rig)
      .def_readonly("frames", &SourceSummary::frames, "Number of frames of the source, or None if unknown.")
      .def_readonly("inspected", &SourceSummary::inspected, "Number of inspected frames.")
      .def_readonly("looked_at", &SourceSummary::inspected, "Earlier name of inspected.")
      .def_readonly("unreadable", &SourceSummary::unreadable, "Number of unreadable frames among them.")
      .def_readonly("first_problem", &SourceSummary::first_problem)
      .def_readonly("seconds", &SourceSummary::seconds, "Seconds from the first to the last inspected frame.")
      .def_readonly("rate", &SourceSummary::rate, "Hz.")
      .def_readonly("nearest", &SourceSummary::nearest, "1st percentile of depth, meters.")
      .def_readonly("median", &SourceSummary::median, "Median depth, meters.")
      .def_readonly("farthest", &SourceSummary::farthest, "99th percentile of depth, meters.")
      .def_readonly("measured_share", &SourceSummary::measured_share,
                    "Fraction of the depth pixels with a measurement.")
      .def_readonly("with_color", &SourceSummary::with_color, "Number of frames with color.")
      .def_readonly("with_pose", &SourceSummary::with_pose, "Number of frames with a pose.")
      .def_readonly("doubts", &SourceSummary::doubts, "Missing or implausible data, one line each.")
      .def("__repr__", [](const SourceSummary& s) {
        return repr("SourceSummary",
                    {{"layout", s.layout}, {"frames", s.frames}, {"rate", s.rate}, {"doubts", s.doubts}});
      });
  m.def(
      "inspect",
      [](GuardedSource& source, int frames) {
        return source.guard->run([&] { return inspect(*source.source, frames); });
      },
      py::arg("source"), py::arg("frames") = 100, R"(inspect(source, frames=100)
--

Reads the first frames of a Source, and returns its contents and implausible data as a SourceSummary.)");
}

/// Writes frames in TUM's layout as they arrive.
struct GuardedRecorder {
  GuardedRecorder(const std::filesystem::path& folder, const Rig& r, double scale, bool png)
      : rig(r), depth_scale(scale), color_as_png(png), recorder(folder, r, scale) {}
  void add(const SizedFrame& frame) {
    expect_images_of(rig, frame);
    guard.run([&] { recorder.add(encode(frame.frame, rig, color_as_png, depth_scale)); });
  }
  Rig rig;
  double depth_scale;
  bool color_as_png;
  Recorder recorder;
  Guard guard;
  SizedFrame scratch;
  int next = 0;
};

struct GuardedWriter {
  Rig rig;
  std::unique_ptr<LayoutWriter> writer;
  std::unique_ptr<Guard> guard = std::make_unique<Guard>();
};

void add_recorder(py::module_& m) {
  py::class_<GuardedRecorder>(m, "Recorder", R"(Recorder(folder, rig, *, depth_scale=5000.0, color_png=False)
--

Writes a recording in the TUM layout, frame by frame. It is readable whenever the program ends.

folder: new or empty. depth_scale: units per meter of the depth images; the range is 13.1 m at 5000. color_png: PNG
instead of JPEG. Raises Error if the folder is not empty.)")
      .def(py::init<const std::filesystem::path&, const Rig&, double, bool>(), py::arg("folder"), py::arg("rig"),
           py::kw_only(), py::arg("depth_scale") = kTumDepthScale, py::arg("color_png") = false,
           R"(__init__(self, folder, rig, *, depth_scale=5000.0, color_png=False)
--

)")
      .def(
          "add",
          [](GuardedRecorder& r, const py::object& depth, const py::object& color, const py::object& time,
             const py::object& depth_scale) {
            if (py::isinstance<SizedFrame>(depth)) return r.add(depth.cast<const SizedFrame&>());
            SizedFrame frame = std::exchange(r.scratch, {});
            fill(frame, {depth, color, time, depth_scale}, r.next++, &r.rig);
            r.add(frame);
            r.scratch = std::move(frame);
          },
          py::arg("depth"), py::arg("color") = py::none(), py::kw_only(), py::arg("time") = py::none(),
          py::arg("depth_scale") = py::none(), R"(add(self, depth, color=None, *, time=None, depth_scale=None)
--

Writes a Frame, or images as for Frame. Raises Error if the disk is full; the recording then stays unchanged.)")
      .def_property_readonly(
          "bytes", [](const GuardedRecorder& r) { return r.recorder.bytes(); }, "Number of bytes written.");

  py::class_<GuardedWriter>(m, "LayoutWriter", R"(LayoutWriter(layout, folder, rig)
--

Writes a recording with poses in the layout of another program or data set (layouts), frame by frame.

folder: empty. Raises Error with the remedy for cameras that the layout cannot store.)")
      .def(py::init([](const std::string& layout, const std::filesystem::path& folder, const Rig& rig) {
             return GuardedWriter{rig, write_layout(layout, folder, rig)};
           }),
           py::arg("layout"), py::arg("folder"), py::arg("rig"), R"(__init__(self, layout, folder, rig)
--

)")
      .def(
          "add",
          [](GuardedWriter& w, const SizedFrame& frame) {
            expect_images_of(w.rig, frame);
            if (!frame.frame.world_from_camera)
              throw py::value_error("the frame has no pose, which the layout requires");
            w.guard->run([&] { w.writer->add(frame.frame); });
          },
          py::arg("frame"), R"(add(self, frame)
--

Writes a Frame with a pose.)")
      .def(
          "finish", [](GuardedWriter& w) { w.guard->run([&] { w.writer->finish(); }); },
          R"(finish(self)
--

Writes the index of the frames; the recording is unreadable before.)");
  m.def(
      "layouts", [] { return std::vector<std::string>(std::begin(kLayouts), std::end(kLayouts)); }, R"(layouts()
--

Names of the layouts for LayoutWriter.)");
}

}  // namespace

std::optional<SizedFrame> GuardedSource::next() {
  if (!is_live) {
    auto frame = guard->run([&] { return source->next(); });
    check_signals();
    if (!frame) return std::nullopt;
    return sized(std::move(*frame), source->rig());
  }
  auto& live = dynamic_cast<LiveSource&>(*source);
  for (;;) {
    auto [frame, ended] = guard->run([&] {
      auto newest = live.next_within(kSignalInterval);
      return std::pair(std::move(newest), live.ended());
    });
    check_signals();
    if (frame) return sized(std::move(*frame), source->rig());
    if (ended) return std::nullopt;
  }
}

BorrowedSource::BorrowedSource(py::object frames, const Rig& rig) {
  if (py::isinstance<GuardedSource>(frames)) {
    auto& source = frames.cast<GuardedSource&>();
    source_ = source.source.get();
    guard_ = source.guard.get();
    return;
  }
  own_ = std::make_unique<IteratedSource>(frames, rig);
  own_guard_ = std::make_unique<Guard>();
  source_ = own_.get();
  guard_ = own_guard_.get();
}

BorrowedSource::~BorrowedSource() = default;

void BorrowedSource::rethrow() const {
  const auto* const iterated = dynamic_cast<const IteratedSource*>(own_.get());
  if (iterated != nullptr && iterated->error) std::rethrow_exception(iterated->error);
}

void add_sources(py::module_& m) {
  add_source(m);
  add_inspection(m);
  add_recorder(m);
}

}  // namespace cairn::python
