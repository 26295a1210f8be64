// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "frames.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "module.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

using Bytes = py::array_t<std::uint8_t, py::array::c_style>;

std::string to_string(const std::array<py::ssize_t, 2>& size) {
  return "(" + std::to_string(size[0]) + ", " + std::to_string(size[1]) + ")";
}

void expect_size(const char* name, const std::array<py::ssize_t, 2>& size, const Camera& camera) {
  if (const std::array<py::ssize_t, 2> expected{camera.height, camera.width}; size != expected)
    throw py::value_error(std::string(name) + " has the shape " + to_string(size) + "; the rig's camera has " +
                          to_string(expected) + " (rows, columns)");
}

py::array image_of(const py::object& value, const char* name, const char* expected) {
  if (!py::isinstance<py::array>(value))
    throw py::type_error(std::string(name) + " is " + description_of(value) + "; " + expected + " is expected");
  return py::reinterpret_borrow<py::array>(value);
}

void expect_measurements(const std::vector<float>& depth) {
  // The bits of finite values of at least 0 range from 0 to kLargestFloat, so neither difference has its sign bit set.
  // Without a branch, the loop is vectorized.
  constexpr std::int32_t kLargestFloat = 0x7f7fffff;
  std::int32_t signs = 0;
  for (const float z : depth) {
    const auto bits = std::bit_cast<std::int32_t>(z);
    signs |= bits | (kLargestFloat - (bits & 0x7fffffff));
  }
  if (signs >= 0) return;
  const auto invalid = std::count_if(depth.begin(), depth.end(), [](float z) { return !(z >= 0 && std::isfinite(z)); });
  if (invalid == 0) return;  // negative zeros
  throw py::value_error("depth has " + std::to_string(invalid) +
                        " negative or non-finite values; set missing measurements to 0 (numpy.nan_to_num)");
}

void fill_depth(SizedFrame& to, const py::object& value, const py::object& depth_scale) {
  constexpr const char* kExpected = "an array of shape (rows, columns), float32 in meters or uint16 with depth_scale,";
  const py::array array = image_of(value, "depth", kExpected);
  if (array.ndim() != 2) throw py::value_error("depth is " + description_of(array) + "; " + kExpected + " is expected");
  const char kind = array.dtype().kind();
  if (kind != 'f' && kind != 'u' && kind != 'i')
    throw py::type_error("depth is " + description_of(array) + "; " + kExpected + " is expected");
  if (kind != 'f' && depth_scale.is_none())
    throw py::value_error("depth is " + description_of(array) +
                          ": give depth_scale, its units per meter (1000 for millimeters)");
  const double scale = depth_scale.is_none() ? 1.0 : depth_scale.cast<double>();
  if (!(scale > 0 && std::isfinite(scale)))
    throw py::value_error("depth_scale is " + std::string(py::str(depth_scale)) + "; units per meter are expected");
  to.depth_size = {array.shape(0), array.shape(1)};
  to.frame.depth.resize(static_cast<std::size_t>(array.size()));
  if (array.dtype().is(py::dtype::of<std::uint16_t>())) {
    const auto units = py::array_t<std::uint16_t, py::array::c_style>::ensure(array);
    const py::gil_scoped_release release;
    std::transform(units.data(), units.data() + units.size(), to.frame.depth.begin(),
                   [scale](std::uint16_t d) { return static_cast<float>(d / scale); });
  } else {
    const auto meters = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(array);
    const py::gil_scoped_release release;
    std::memcpy(to.frame.depth.data(), meters.data(), sizeof(float) * static_cast<std::size_t>(meters.size()));
    if (scale != 1)
      for (float& z : to.frame.depth) z = static_cast<float>(z / scale);
  }
  expect_measurements(to.frame.depth);
}

/// Converts pixels of kChannels bytes to R, G, B, 255; reads four bytes at once except for the last pixel.
template <int kChannels>
void copy_color(const std::uint8_t* from, std::vector<std::uint32_t>& to) {
  if (to.empty()) return;
  for (std::size_t i = 0; i + 1 < to.size(); ++i) {
    std::uint32_t word = 0;
    std::memcpy(&word, from + i * kChannels, sizeof word);
    to[i] = 0xff000000u | (word & 0xffffffu);
  }
  std::uint32_t last = 0;
  std::memcpy(&last, from + (to.size() - 1) * kChannels, 3);
  to.back() = 0xff000000u | last;
}

void fill_color(SizedFrame& to, const py::object& value) {
  to.frame.color.clear();
  to.color_size = {};
  if (value.is_none()) return;
  constexpr const char* kExpected =
      "uint8 of shape (rows, columns, 3), R, G, B, or (rows, columns, 4) with an ignored channel,";
  const py::array array = image_of(value, "color", kExpected);
  if (!array.dtype().is(py::dtype::of<std::uint8_t>()))
    throw py::type_error("color is " + description_of(array) + "; " + kExpected + " is expected");
  if (array.ndim() != 3 || (array.shape(2) != 3 && array.shape(2) != 4))
    throw py::value_error("color is " + description_of(array) + "; " + kExpected + " is expected");
  const auto bytes = Bytes::ensure(array);
  to.color_size = {array.shape(0), array.shape(1)};
  to.frame.color.resize(static_cast<std::size_t>(array.shape(0) * array.shape(1)));
  const std::uint8_t* from = bytes.data();
  const py::gil_scoped_release release;
  if (array.shape(2) == 4)
    copy_color<4>(from, to.frame.color);
  else
    copy_color<3>(from, to.frame.color);
}

void fill_confidence(SizedFrame& to, const py::object& value) {
  to.frame.confidence.clear();
  if (value.is_none()) return;
  const py::array array = image_of(value, "confidence", "uint8 of depth's shape");
  if (!array.dtype().is(py::dtype::of<std::uint8_t>()) || array.ndim() != 2 || array.shape(0) != to.depth_size[0] ||
      array.shape(1) != to.depth_size[1])
    throw py::value_error("confidence is " + description_of(array) + "; uint8 of depth's shape " +
                          to_string(to.depth_size) + " is expected, 0 to 255 (certain)");
  const auto bytes = Bytes::ensure(array);
  to.frame.confidence.assign(bytes.data(), bytes.data() + bytes.size());
}

/// Samples `timestamp x y z` of a sensor.
template <class Sample>
std::vector<Sample> samples_of(const py::object& value, const char* name, const char* unit) {
  if (value.is_none()) return {};
  const auto numbers = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(value);
  if (!numbers || numbers.ndim() != 2 || numbers.shape(1) != 4) {
    PyErr_Clear();
    throw py::value_error(name + (" is " + description_of(value)) + "; (N, 4) is expected: seconds, and " + unit);
  }
  std::vector<Sample> samples;
  for (py::ssize_t i = 0; i < numbers.shape(0); ++i)
    samples.push_back({numbers.at(i, 0), {numbers.at(i, 1), numbers.at(i, 2), numbers.at(i, 3)}});
  return samples;
}

double time_of(const py::object& value) {
  if (value.is_none()) throw py::type_error("time is missing: seconds, increasing from frame to frame");
  const double time = value.cast<double>();
  if (!std::isfinite(time)) throw py::value_error("time is " + std::string(py::str(value)) + "; seconds are expected");
  return time;
}

py::object depth_of(const py::object& self) {
  const auto& f = self.cast<const SizedFrame&>();
  if (f.frame.depth.empty()) return py::none();
  return view(f.frame.depth.data(), {f.depth_size[0], f.depth_size[1]}, self);
}

py::object color_of(const py::object& self) {
  const auto& f = self.cast<const SizedFrame&>();
  if (f.frame.color.empty()) return py::none();
  return py::array_t<std::uint8_t>({f.color_size[0], f.color_size[1], py::ssize_t{3}},
                                   {4 * f.color_size[1], py::ssize_t{4}, py::ssize_t{1}},
                                   reinterpret_cast<const std::uint8_t*>(f.frame.color.data()), self);
}

py::object confidence_of(const py::object& self) {
  const auto& f = self.cast<const SizedFrame&>();
  if (f.frame.confidence.empty()) return py::none();
  return view(f.frame.confidence.data(), {f.depth_size[0], f.depth_size[1]}, self);
}

template <class Sample>
Doubles to_rows(const std::vector<Sample>& samples, Eigen::Vector3d Sample::*value) {
  Doubles rows({static_cast<py::ssize_t>(samples.size()), py::ssize_t{4}});
  double* to = rows.mutable_data();
  for (const Sample& sample : samples) {
    const Eigen::Vector3d& v = sample.*value;
    for (const double number : {sample.timestamp, v.x(), v.y(), v.z()}) *to++ = number;
  }
  return rows;
}

}  // namespace

void expect_images_of(const Rig& rig, const SizedFrame& frame) {
  if (frame.frame.problem) throw py::value_error("the frame has no images: " + *frame.frame.problem);
  expect_size("depth", frame.depth_size, rig.depth);
  if (!frame.frame.color.empty()) expect_size("color", frame.color_size, rig.color_view());
}

void fill(SizedFrame& to, const FrameParts& parts, int index, const Rig* rig) {
  to.frame.problem.reset();
  to.frame.index = index;
  to.frame.timestamp = time_of(parts.time);
  fill_depth(to, parts.depth, parts.depth_scale);
  fill_color(to, parts.color);
  if (rig != nullptr) expect_images_of(*rig, to);
  fill_confidence(to, parts.confidence);
  to.frame.color_delay = parts.color_delay;
  to.frame.world_from_camera = optional_pose_of(parts.pose, "pose");
  to.frame.guess = optional_pose_of(parts.guess, "guess");
  to.frame.acceleration.reset();
  if (!parts.acceleration.is_none()) to.frame.acceleration = vector_of(parts.acceleration, "acceleration");
  to.frame.gyro = samples_of<AngularRate>(parts.gyro, "gyro", "rad/s about x, y, z");
  to.frame.accelerations = samples_of<Acceleration>(parts.accelerations, "accelerations", "m/s^2 along x, y, z");
  to.frame.held_out = parts.held_out;
}

void add_frames(py::module_& m) {
  py::class_<SizedFrame, std::shared_ptr<SizedFrame>>(
      m, "Frame",
      R"(Frame(depth, color=None, *, time, index=0, depth_scale=None, confidence=None, color_delay=0.0, pose=None, guess=None, acceleration=None, gyro=None, accelerations=None, held_out=False)
--

One RGB-D frame.

depth: (rows, columns), float32 meters along z, or uint16 with depth_scale in units per meter; 0: no measurement.
color: (rows, columns, 3 or 4) uint8, R, G, B (sRGB). time: seconds, increasing from frame to frame. confidence: uint8
of depth's shape, 0 to 255 (certain). color_delay: seconds from the depth timestamp to the color timestamp. pose: (4,
4), world_from_camera, if known. guess: (4, 4), world_from_camera of an external odometry, in its own world frame.
acceleration: (3,), mean accelerometer reading, m/s^2 in the camera's frame; at rest 9.81 upward. gyro: (N, 4), seconds
and rad/s about x, y, z, since the previous frame; accelerations: (N, 4), seconds and m/s^2 in the camera's frame, same.
held_out: for evaluation; a Mapper estimates the pose but does not add the frame to the map.)")
      .def(
          py::init([](py::object depth, py::object color, py::object time, int index, py::object depth_scale,
                      py::object confidence, double color_delay, py::object pose, py::object guess,
                      py::object acceleration, py::object gyro, py::object accelerations, bool held_out) {
            auto frame = std::make_shared<SizedFrame>();
            fill(*frame,
                 {std::move(depth), std::move(color), std::move(time), std::move(depth_scale), std::move(confidence),
                  std::move(pose), std::move(guess), std::move(acceleration), std::move(gyro), std::move(accelerations),
                  color_delay, held_out},
                 index, nullptr);
            return frame;
          }),
          py::arg("depth"), py::arg("color") = py::none(), py::kw_only(), py::arg("time") = py::none(),
          py::arg("index") = 0, py::arg("depth_scale") = py::none(), py::arg("confidence") = py::none(),
          py::arg("color_delay") = 0.0, py::arg("pose") = py::none(), py::arg("guess") = py::none(),
          py::arg("acceleration") = py::none(), py::arg("gyro") = py::none(), py::arg("accelerations") = py::none(),
          py::arg("held_out") = false,
          R"(__init__(self, depth, color=None, *, time, index=0, depth_scale=None, confidence=None, color_delay=0.0, pose=None, guess=None, acceleration=None, gyro=None, accelerations=None, held_out=False)
--

)")
      .def_property_readonly(
          "index", [](const SizedFrame& f) { return f.frame.index; }, "Position in the source, counted from 0.")
      .def_property_readonly(
          "time", [](const SizedFrame& f) { return f.frame.timestamp; }, "Seconds.")
      .def_property_readonly("depth", &depth_of,
                             "(rows, columns) float32, meters; 0: no measurement. None for an unreadable frame. A view "
                             "of the frame's memory.")
      .def_property_readonly("color", &color_of,
                             "(rows, columns, 3) uint8, R, G, B, or None. A view of the frame's memory.")
      .def_property_readonly("confidence", &confidence_of, "(rows, columns) uint8, 0 to 255 (certain), or None.")
      .def_property_readonly(
          "color_delay", [](const SizedFrame& f) { return f.frame.color_delay; },
          "Seconds from the depth timestamp to the color timestamp.")
      .def_property(
          "pose", [](const SizedFrame& f) { return to_numpy(f.frame.world_from_camera); },
          [](SizedFrame& f, const py::object& pose) { f.frame.world_from_camera = optional_pose_of(pose, "pose"); },
          "(4, 4) float64, given world_from_camera, or None. Writable.")
      .def_property(
          "guess", [](const SizedFrame& f) { return to_numpy(f.frame.guess); },
          [](SizedFrame& f, const py::object& pose) { f.frame.guess = optional_pose_of(pose, "guess"); },
          "(4, 4) float64, world_from_camera of an external odometry, or None. Writable.")
      .def_property_readonly(
          "acceleration",
          [](const SizedFrame& f) -> py::object {
            return f.frame.acceleration ? py::object(to_numpy(*f.frame.acceleration)) : py::none();
          },
          "(3,) float64, m/s^2 in the camera's frame, or None.")
      .def_property_readonly(
          "gyro", [](const SizedFrame& f) { return to_rows(f.frame.gyro, &AngularRate::rate); },
          "(N, 4) float64, seconds and rad/s about x, y, z.")
      .def_property_readonly(
          "accelerations", [](const SizedFrame& f) { return to_rows(f.frame.accelerations, &Acceleration::value); },
          "(N, 4) float64, seconds and m/s^2 in the camera's frame.")
      .def_property(
          "held_out", [](const SizedFrame& f) { return f.frame.held_out; },
          [](SizedFrame& f, bool held_out) { f.frame.held_out = held_out; },
          "Held out for evaluation: not added to the map. Writable.")
      .def_property_readonly(
          "problem", [](const SizedFrame& f) { return f.frame.problem; }, "Reason for an unreadable frame, or None.")
      .def("__repr__", [](const SizedFrame& f) {
        return repr(
            "Frame",
            {{"index", f.frame.index}, {"time", f.frame.timestamp}, {"depth", f.depth_size}, {"color", f.color_size}});
      });
}

}  // namespace cairn::python
