// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "cairn/atomic_file.hpp"
#include "io/camera_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kDepthScale = 5000.0;  // units per metre, as in the TUM benchmark

}  // namespace

EncodedFrame encode(const Frame& frame, const Rig& rig, bool colour_as_png) {
  EncodedFrame encoded{.timestamp = frame.timestamp,
                       .colour_delay = frame.colour_delay,
                       .colour_extension = colour_as_png ? ".png" : ".jpg",
                       .acceleration = frame.acceleration};
  cv::Mat depth(rig.depth.height, rig.depth.width, CV_16U);
  std::transform(frame.depth.begin(), frame.depth.end(), depth.ptr<std::uint16_t>(), [](float z) {
    const double units = std::round(static_cast<double>(z) * kDepthScale);
    return static_cast<std::uint16_t>(units > 65535 ? 0 : units);
  });
  const std::vector<int> options{cv::IMWRITE_PNG_COMPRESSION, 1, cv::IMWRITE_JPEG_QUALITY, 95};
  cv::imencode(".png", depth, encoded.depth, options);
  const Camera& view = rig.colour_view();
  if (frame.colour.size() == static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height)) {
    cv::Mat bgr;
    cv::cvtColor(cv::Mat(view.height, view.width, CV_8UC4, const_cast<std::uint32_t*>(frame.colour.data())), bgr,
                 cv::COLOR_RGBA2BGR);
    cv::imencode(encoded.colour_extension, bgr, encoded.colour, options);
  }
  return encoded;
}

Recorder::Recorder(fs::path folder, const Rig& rig) : folder_(std::move(folder)) {
  if (fs::exists(folder_) && !(fs::is_directory(folder_) && fs::is_empty(folder_)))
    throw std::runtime_error(folder_.string() + ": exists and is not empty; choose another folder with -o");
  std::error_code error;
  for (const char* images : {"rgb", "depth"}) fs::create_directories(folder_ / images, error);
  if (error) throw std::runtime_error("cannot make the folder " + folder_.string() + ": " + error.message());
  write_whole(folder_ / "camera.yaml", camera_file_text({.rig = rig, .depth_scale = kDepthScale}));
  for (const char* list : {"rgb.txt", "depth.txt"}) write_whole(folder_ / list, "# timestamp filename\n");
}

void Recorder::add(const EncodedFrame& frame) {
  const std::string name = fmt::format("{:.6f}", frame.timestamp);
  const std::string depth = "depth/" + name + ".png",
                    colour_time = fmt::format("{:.6f}", frame.timestamp + frame.colour_delay),
                    colour = "rgb/" + name + frame.colour_extension;
  // Nothing is waited for: the sensor goes on.
  write_whole(folder_ / depth, frame.depth, Durable::some_time);
  if (!frame.colour.empty()) write_whole(folder_ / colour, frame.colour, Durable::some_time);
  bytes_ += frame.depth.size() + frame.colour.size();
  if (!frame.colour.empty()) append("rgb.txt", colour_time + " " + colour + "\n");
  if (frame.acceleration)  // in a Kinect's axes: y up, z forward
    append("accelerometer.txt", fmt::format("{} {:.6f} {:.6f} {:.6f}\n", name, -frame.acceleration->x(),
                                            -frame.acceleration->y(), frame.acceleration->z()));
  append("depth.txt", name + " " + depth + "\n");
}

/// A line is written whole or cut off again.
void Recorder::append(const char* list, const std::string& line) {
  const fs::path file = folder_ / list;
  std::error_code ignored;
  const auto before = fs::exists(file) ? fs::file_size(file) : 0;
  std::ofstream out(file, std::ios::app);
  if (before == 0 && std::string_view(list) == "accelerometer.txt") out << "# timestamp ax ay az\n";
  out << line;
  if (out.flush()) return;
  out.close();
  fs::resize_file(file, before, ignored);
  throw std::runtime_error("cannot write " + file.string() + ": the disk is full");
}

}  // namespace cairn
