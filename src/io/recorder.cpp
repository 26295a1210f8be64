// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "geometry/encode_frame.hpp"
#include "io/camera_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr float kMaxUnits = 65535;                         // maximum unit value of a depth image
constexpr double kScales[] = {1000, 5000, 6553.5, 10000};  // common units per meter

/// True if a file with this unit reproduces every depth value exactly.
bool reproduces(const std::vector<float>& depth, double scale) {
  const auto meters = static_cast<float>(1.0 / scale);
  return std::all_of(depth.begin(), depth.end(), [&](float z) {
    const auto units = static_cast<float>(std::round(static_cast<double>(z) * scale));
    return units <= kMaxUnits && units * meters == z;
  });
}

/// Lines of accelerometer.txt: the samples, or their mean, in a Kinect's axes: y up, z forward.
std::string accelerations_of(const EncodedFrame& frame) {
  std::string lines;
  const auto add = [&](double timestamp, const Eigen::Vector3d& a) {
    lines += fmt::format("{:.6f} {:.6f} {:.6f} {:.6f}\n", timestamp, -a.x(), -a.y(), a.z());
  };
  for (const Acceleration& sample : frame.accelerations) add(sample.timestamp, sample.value);
  if (frame.accelerations.empty() && frame.acceleration) add(frame.timestamp, *frame.acceleration);
  return lines;
}

}  // namespace

double exact_depth_scale(const Frame& frame) {
  const auto* found = std::find_if(std::begin(kScales), std::end(kScales),
                                   [&](double scale) { return reproduces(frame.depth, scale); });
  return found == std::end(kScales) ? kTumDepthScale : *found;
}

EncodedFrame encode(const Frame& frame, const Rig& rig, bool color_as_png, double depth_scale) {
  EncodedFrame encoded{.timestamp = frame.timestamp,
                       .color_delay = frame.color_delay,
                       .color_extension = color_as_png ? ".png" : ".jpg",
                       .acceleration = frame.acceleration,
                       .gyro = frame.gyro,
                       .accelerations = frame.accelerations};
  encoded.depth = encode_depth(frame.depth, rig.depth, depth_scale);
  if (frame.confidence.size() == frame.depth.size())
    encoded.confidence = encode_png(
        cv::Mat(rig.depth.height, rig.depth.width, CV_8U, const_cast<std::uint8_t*>(frame.confidence.data())));
  const Camera& view = rig.color_view();
  if (frame.color.size() == static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height))
    encoded.color = encode_color(frame.color, view, encoded.color_extension.c_str());
  return encoded;
}

Recorder::Recorder(fs::path folder, const Rig& rig, double depth_scale) : folder_(std::move(folder)) {
  if (fs::exists(folder_) && !(fs::is_directory(folder_) && fs::is_empty(folder_)))
    throw std::runtime_error(folder_.string() + ": exists and is not empty; choose another folder");
  std::error_code error;
  fs::create_directories(folder_, error);
  for (const char* images : {"rgb", "depth"})
    if (!error && !fs::create_directory(folder_ / images, error) && !error)
      throw std::runtime_error(folder_.string() + ": another program just wrote to it; choose another folder");
  if (error) throw std::runtime_error("cannot create the folder " + folder_.string() + ": " + error.message());
  write_whole(folder_ / "camera.yaml", camera_file_text({.rig = rig, .depth_scale = depth_scale}));
  for (const char* list : {"rgb.txt", "depth.txt"}) write_whole(folder_ / list, "# timestamp filename\n");
}

void Recorder::add(const EncodedFrame& frame) {
  const std::string name = fmt::format("{:.6f}", frame.timestamp);
  const std::string depth = "depth/" + name + ".png",
                    color_time = fmt::format("{:.6f}", frame.timestamp + frame.color_delay),
                    color = "rgb/" + name + frame.color_extension;
  // No wait for the disk: the sensor continues.
  write_whole(folder_ / depth, frame.depth, Durable::some_time);
  if (!frame.color.empty()) write_whole(folder_ / color, frame.color, Durable::some_time);
  if (!frame.confidence.empty()) {
    fs::create_directories(folder_ / "confidence");
    write_whole(folder_ / "confidence" / (name + ".png"), frame.confidence, Durable::some_time);
  }
  bytes_ += frame.depth.size() + frame.color.size();
  if (!frame.color.empty()) append("rgb.txt", color_time + " " + color + "\n");
  if (const std::string accelerations = accelerations_of(frame); !accelerations.empty())
    append("accelerometer.txt", accelerations);
  std::string rates;
  for (const AngularRate& s : frame.gyro)
    rates += fmt::format("{:.6f} {:.8f} {:.8f} {:.8f}\n", s.timestamp, s.rate.x(), s.rate.y(), s.rate.z());
  if (!rates.empty()) append("gyroscope.txt", rates);
  append("depth.txt", name + " " + depth + "\n");
}

/// Appends a complete line, or restores the file's old length.
void Recorder::append(const char* list, const std::string& line) {
  const fs::path file = folder_ / list;
  std::error_code ignored;
  const auto before = fs::exists(file) ? fs::file_size(file) : 0;
  std::ofstream out(file, std::ios::app);
  if (before == 0 && std::string_view(list) == "accelerometer.txt") out << "# timestamp ax ay az\n";
  if (before == 0 && std::string_view(list) == "gyroscope.txt") out << "# timestamp rx ry rz\n";
  out << line;
  if (out.flush()) return;
  out.close();
  fs::resize_file(file, before, ignored);
  throw std::runtime_error("cannot write " + file.string() + ": the disk is full");
}

}  // namespace cairn
