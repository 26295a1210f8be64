// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/keyframe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "base/image_file.hpp"
#include "cairn/atomic_file.hpp"
#include "map/keyframe_files.hpp"

namespace cairn {
namespace {

constexpr double kTurn = 0.15, kDistance = 0.12;                                             // rad, m between keyframes
constexpr double kDepthSteps = 5000;                                                         // per meter
constexpr const char *kDepth = "depth.png", *kColour = "colour.jpg", *kCorners = "corners";  // file names of a keyframe
constexpr std::size_t kRecent = 256;  // keyframes whose features stay in memory, 58 KB each
constexpr const char* kRemedy = "the session is damaged: begin a new session";

/// File format of a feature.
struct Corner {
  double ray[2], point[3];
  std::array<std::uint8_t, 32> descriptor;
};

/// Version byte, followed by the features.
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

/// Inverse of bytes_of. The bytes after the version byte must be complete features.
Features features_in(const std::vector<std::uint8_t>& bytes) {
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

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::filesystem::path file_of(const NumberedFiles& files, std::size_t keyframe, const char* what) {
  const NumberedFiles::Place place = files[keyframe];
  return place.folder / fmt::format("{:06}.{}", place.number, what);
}

}  // namespace

bool is_keyframe_file(std::string_view name) {
  const std::size_t dot = std::min(name.find('.'), name.size());
  const std::string_view what = name.substr(std::min(dot + 1, name.size()));
  return dot >= 6 && name.find_first_not_of("0123456789") == dot &&
         (what == kDepth || what == kColour || what == kCorners);
}

std::filesystem::path colour_file(const NumberedFiles& files, std::size_t keyframe) {
  return file_of(files, keyframe, kColour);
}

bool is_apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double times) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() >= times * kDistance ||
         Eigen::AngleAxisd(motion.linear()).angle() >= times * kTurn;
}

KeyframeStore::KeyframeStore(const Rig& rig, NumberedFiles files, Access access)
    : rig_(rig), files_(std::move(files)), writes_(in_files() && access == Access::write) {}

std::filesystem::path KeyframeStore::file(std::size_t keyframe, const char* what) const {
  return file_of(files_, keyframe, what);
}

void KeyframeStore::put(std::size_t keyframe, const Frame& frame, Features features) {
  const auto corners = std::make_shared<const Features>(std::move(features));
  const auto lock = quiet();
  remember(keyframe, corners);
  writing_ =
      std::async(std::launch::async, [this, keyframe, depth = frame.depth, colour = frame.colour, corners]() mutable {
        Packed packed;
        packed.corners = bytes_of(*corners);
        packed_.erase(keyframe);
        try {
          packed.depth = encode_depth(depth, rig_.depth, kDepthSteps);
          if (!colour.empty()) packed.colour = encode_colour(colour, rig_.colour_view(), ".jpg");
          if (writes_) return write(keyframe, packed);
        } catch (const std::exception&) {
          // Stays in memory until store().
        }
        packed_[keyframe] = std::move(packed);
      });
}

void KeyframeStore::correct(std::size_t keyframe, const DepthCorrection& correction) {
  if (files_.is_elsewhere(keyframe))
    throw std::runtime_error(file(keyframe, kDepth).string() + ": is another map's and stays as it is");
  std::vector<float> depth = get(keyframe).depth;
  correction.apply(rig_.depth.width, rig_.depth.height, depth);
  auto packed = encode_depth(depth, rig_.depth, kDepthSteps);
  const auto lock = quiet();
  if (const auto kept = packed_.find(keyframe); kept != packed_.end())
    kept->second.depth = std::move(packed);
  else
    write_whole(file(keyframe, kDepth), packed, Durable::some_time);
}

void KeyframeStore::write(std::size_t keyframe, const Packed& packed) const {
  // Not synced here: a checkpoint syncs all files at once, see SessionWriter.
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

std::unique_lock<std::mutex> KeyframeStore::quiet() const {
  std::unique_lock lock(mutex_);
  if (writing_.valid()) writing_.get();
  return lock;
}

void KeyframeStore::wait() const { (void)quiet(); }

std::optional<std::string> KeyframeStore::store() {
  const auto lock = quiet();
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

std::vector<std::uint8_t> KeyframeStore::kept(std::size_t keyframe, std::vector<std::uint8_t> Packed::*part,
                                              const char* what) const {
  {
    const auto lock = quiet();
    if (const auto found = packed_.find(keyframe); found != packed_.end()) return found->second.*part;
  }
  return read_bytes(file(keyframe, what));
}

std::shared_ptr<const Features> KeyframeStore::features(std::size_t keyframe) const {
  if (auto known = remembered(keyframe)) return known;
  const auto bytes = kept(keyframe, &Packed::corners, kCorners);
  if (bytes.empty() || bytes.size() % sizeof(Corner) != 1)
    throw std::runtime_error(file(keyframe, kCorners).string() + ": is missing or broken; " + kRemedy);
  auto features = std::make_shared<const Features>(features_in(bytes));
  remember(keyframe, features);
  return features;
}

void KeyframeStore::remember(std::size_t keyframe, std::shared_ptr<const Features> features) const {
  const std::lock_guard lock(recent_mutex_);
  recent_[keyframe] = {std::move(features), ++use_};
  if (recent_.size() <= kRecent) return;
  recent_.erase(std::min_element(recent_.begin(), recent_.end(),
                                 [](const auto& a, const auto& b) { return a.second.last_use < b.second.last_use; }));
}

std::shared_ptr<const Features> KeyframeStore::remembered(std::size_t keyframe) const {
  const std::lock_guard lock(recent_mutex_);
  const auto found = recent_.find(keyframe);
  if (found == recent_.end()) return nullptr;
  found->second.last_use = ++use_;
  return found->second.features;
}

namespace {

cv::Mat decoded(const std::vector<std::uint8_t>& bytes, Pixels pixels, const Camera& camera) {
  try {
    if (!bytes.empty()) return decode_image(bytes, pixels, {.size = {camera.width, camera.height}});
  } catch (const std::runtime_error&) {
    // The caller reports the error or continues without the image.
  }
  return {};
}

}  // namespace

std::vector<float> KeyframeStore::depth(std::size_t keyframe) const {
  const cv::Mat steps = decoded(kept(keyframe, &Packed::depth, kDepth), Pixels::as_stored, rig_.depth);
  if (steps.type() != CV_16U || steps.empty())
    throw std::runtime_error(file(keyframe, kDepth).string() + ": is missing or broken; " + kRemedy);
  std::vector<float> metres(steps.total());
  cv::Mat depth(steps.rows, steps.cols, CV_32F, metres.data());
  steps.convertTo(depth, CV_32F, 1 / kDepthSteps);
  return metres;
}

Frame KeyframeStore::get(std::size_t keyframe) const {
  Frame frame;
  frame.depth = depth(keyframe);
  const cv::Mat rgba = decoded(kept(keyframe, &Packed::colour, kColour), Pixels::rgba, rig_.colour_view());
  if (!rgba.empty()) frame.colour = colour_pixels(rgba);
  return frame;
}

}  // namespace cairn
