// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/keyframe.hpp"

#include <fmt/format.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "base/image_file.hpp"
#include "cairn/atomic_file.hpp"

namespace cairn {
namespace {

constexpr double kTurn = 0.15, kDistance = 0.12;  // radians, metres between keyframes
constexpr double kDepthSteps = 5000;              // a metre
constexpr const char *kDepth = "depth.png", *kColour = "colour.jpg", *kCorners = "corners";  // files of a keyframe
constexpr const char* kRemedy = "the session is damaged: begin a new session";

/// A corner in its file.
struct Corner {
  double ray[2], point[3];
  std::array<std::uint8_t, 32> descriptor;
};

/// A version byte, then the corners.
std::vector<std::uint8_t> bytes_of(const Features& features) {
  std::vector<std::uint8_t> bytes(1 + features.rays.size() * sizeof(Corner), 1);
  for (std::size_t i = 0; i < features.rays.size(); ++i) {
    const auto& r = features.rays[i];
    const auto& p = features.points[i];
    const Corner corner{{r.x(), r.y()}, {p.x(), p.y(), p.z()}, features.descriptors[i]};
    std::memcpy(&bytes[1 + i * sizeof corner], &corner, sizeof corner);
  }
  return bytes;
}

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::filesystem::path file_of(const std::filesystem::path& folder, std::size_t keyframe, const char* what) {
  return folder / fmt::format("{:06}.{}", keyframe, what);
}

}  // namespace

std::filesystem::path colour_file(const std::filesystem::path& folder, std::size_t keyframe) {
  return file_of(folder, keyframe, kColour);
}

bool is_apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() >= kDistance || Eigen::AngleAxisd(motion.linear()).angle() >= kTurn;
}

KeyframeStore::KeyframeStore(const Rig& rig, std::filesystem::path folder, Access access)
    : rig_(rig), folder_(std::move(folder)), writes_(!folder_.empty() && access == Access::write) {}

std::filesystem::path KeyframeStore::file(std::size_t keyframe, const char* what) const {
  return file_of(folder_, keyframe, what);
}

void KeyframeStore::put(std::size_t keyframe, const Frame& frame, const Features& features) {
  wait();
  writing_ = std::async(std::launch::async, [this, keyframe, depth = frame.depth, colour = frame.colour,
                                             corners = bytes_of(features)]() mutable {
    Packed packed;
    packed.corners = std::move(corners);
    packed_.erase(keyframe);
    try {
      packed.depth = encode_depth(depth, rig_.depth, kDepthSteps);
      if (!colour.empty()) packed.colour = encode_colour(colour, rig_.colour_view(), ".jpg");
      if (writes_) return write(keyframe, packed);
    } catch (const std::exception&) {
      // It stays in memory until store().
    }
    packed_[keyframe] = std::move(packed);
  });
}

void KeyframeStore::correct(std::size_t keyframe, const DepthCorrection& correction) {
  std::vector<float> depth = get(keyframe).depth;
  correction.apply(rig_.depth.width, rig_.depth.height, depth);
  auto packed = encode_depth(depth, rig_.depth, kDepthSteps);
  if (const auto kept = packed_.find(keyframe); kept != packed_.end())
    kept->second.depth = std::move(packed);
  else
    write_whole(file(keyframe, kDepth), packed, Durable::some_time);
}

void KeyframeStore::write(std::size_t keyframe, const Packed& packed) const {
  // A checkpoint brings them to the disk all at once, see SessionWriter.
  write_whole(file(keyframe, kDepth), packed.depth, Durable::some_time);
  if (!packed.colour.empty()) write_whole(file(keyframe, kColour), packed.colour, Durable::some_time);
  write_whole(file(keyframe, kCorners), packed.corners, Durable::some_time);
}

void KeyframeStore::copy(std::size_t keyframe, const KeyframeStore& from, std::size_t its) const {
  wait();
  from.wait();
  for (const char* what : {kDepth, kCorners, kColour})
    if (std::filesystem::exists(from.file(its, what)))
      write_whole(file(keyframe, what), read_bytes(from.file(its, what)), Durable::some_time);
}

void KeyframeStore::wait() const {
  if (writing_.valid()) writing_.get();
}

std::optional<std::string> KeyframeStore::store() {
  wait();
  if (!writes_) return std::nullopt;
  try {
    while (!packed_.empty()) {
      write(packed_.begin()->first, packed_.begin()->second);
      packed_.erase(packed_.begin());
    }
    return std::nullopt;
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

Features KeyframeStore::features(std::size_t keyframe) const {
  wait();
  const auto bytes = read_bytes(file(keyframe, kCorners));
  if (bytes.empty() || bytes.size() % sizeof(Corner) != 1)
    throw std::runtime_error(file(keyframe, kCorners).string() + ": is missing or broken; " + kRemedy);
  Features features;
  for (std::size_t at = 1; at < bytes.size(); at += sizeof(Corner)) {
    Corner corner;
    std::memcpy(&corner, &bytes[at], sizeof corner);
    features.rays.emplace_back(corner.ray[0], corner.ray[1]);
    features.points.emplace_back(corner.point[0], corner.point[1], corner.point[2]);
    features.descriptors.push_back(corner.descriptor);
  }
  return features;
}

Frame KeyframeStore::get(std::size_t keyframe) const {
  wait();
  const auto kept = packed_.find(keyframe);
  const Packed packed = kept != packed_.end()
                            ? kept->second
                            : Packed{read_bytes(file(keyframe, kDepth)), read_bytes(file(keyframe, kColour)), {}};
  cv::Mat steps, rgba;
  const auto decoded = [](const std::vector<std::uint8_t>& bytes, Pixels pixels) {
    try {
      return decode_image(bytes, pixels);
    } catch (const std::runtime_error&) {
      return cv::Mat();  // told below, or left out
    }
  };
  if (!packed.depth.empty()) steps = decoded(packed.depth, Pixels::as_stored);
  if (steps.type() != CV_16U || steps.cols != rig_.depth.width || steps.rows != rig_.depth.height)
    throw std::runtime_error(file(keyframe, kDepth).string() + ": is missing or broken; " + kRemedy);
  Frame frame;
  frame.depth.resize(steps.total());
  cv::Mat depth(steps.rows, steps.cols, CV_32F, frame.depth.data());
  steps.convertTo(depth, CV_32F, 1 / kDepthSteps);
  if (!packed.colour.empty()) rgba = decoded(packed.colour, Pixels::rgba);
  if (rgba.cols == rig_.colour_view().width && rgba.rows == rig_.colour_view().height)
    frame.colour = colour_pixels(rgba);
  return frame;
}

}  // namespace cairn
