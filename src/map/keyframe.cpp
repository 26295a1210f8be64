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

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "geometry/encode_frame.hpp"
#include "map/keyframe_files.hpp"

namespace cairn {
namespace {

constexpr double kKeyframeAngle = 0.15, kKeyframeDistance = 0.12;  // rad, m between keyframes
constexpr double kDepthStepsPerMeter = 5000;                       // per meter
constexpr std::uint16_t kMaskedSteps = 65535;  // stored depth of a pixel without depth and color: a masked pixel
constexpr const char *kDepth = "depth.png", *kColor = "colour.jpg", *kCorners = "corners";  // file names of a keyframe
constexpr std::size_t kMaxCachedFeatures = 256;  // keyframes whose features stay in memory, 58 KB each
constexpr const char* kRemedy = "the session is damaged: begin a new session";

/// File format of a feature.
struct StoredFeature {
  double ray[2], point[3];
  std::array<std::uint8_t, 32> descriptor;
};

/// Version byte, followed by the features.
std::vector<std::uint8_t> bytes_of(const Features& features) {
  std::vector<std::uint8_t> bytes(1 + features.rays.size() * sizeof(StoredFeature), 1);
  for (std::size_t i = 0; i < features.rays.size(); ++i) {
    const auto& r = features.rays[i];
    const auto& p = features.points[i];
    const StoredFeature stored{{r.x(), r.y()}, {p.x(), p.y(), p.z()}, features.descriptors[i]};
    std::memcpy(&bytes[1 + i * sizeof stored], &stored, sizeof stored);
  }
  return bytes;
}

/// Inverse of bytes_of. The bytes after the version byte must be complete features.
Features features_in(const std::vector<std::uint8_t>& bytes) {
  Features features;
  for (std::size_t at = 1; at < bytes.size(); at += sizeof(StoredFeature)) {
    StoredFeature stored;
    std::memcpy(&stored, &bytes[at], sizeof stored);
    features.rays.emplace_back(stored.ray[0], stored.ray[1]);
    features.points.emplace_back(stored.point[0], stored.point[1], stored.point[2]);
    features.descriptors.push_back(stored.descriptor);
  }
  return features;
}

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::filesystem::path file_of(const NumberedFiles& files, std::size_t keyframe, const char* name) {
  const NumberedFiles::Place place = files[keyframe];
  return place.folder / fmt::format("{:06}.{}", place.number, name);
}

/// Depth of a frame for the depth file, with a mark at pixels without depth whose registered color has alpha 0.
std::vector<float> marked_depth(std::vector<float> depth, const std::vector<std::uint32_t>& color) {
  for (std::size_t i = 0; i < std::min(depth.size(), color.size()); ++i)
    if (depth[i] == 0 && color[i] >> 24 == 0) depth[i] = static_cast<float>(kMaskedSteps / kDepthStepsPerMeter);
  return depth;
}

}  // namespace

bool is_keyframe_file(std::string_view name) {
  const std::size_t dot = std::min(name.find('.'), name.size());
  const std::string_view suffix = name.substr(std::min(dot + 1, name.size()));
  return dot >= 6 && name.find_first_not_of("0123456789") == dot &&
         (suffix == kDepth || suffix == kColor || suffix == kCorners);
}

std::filesystem::path color_file(const NumberedFiles& files, std::size_t keyframe) {
  return file_of(files, keyframe, kColor);
}

bool exceeds_keyframe_distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double factor) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() >= factor * kKeyframeDistance ||
         Eigen::AngleAxisd(motion.linear()).angle() >= factor * kKeyframeAngle;
}

KeyframeStore::KeyframeStore(const Rig& rig, NumberedFiles files, Access access)
    : rig_(rig), files_(std::move(files)), is_writable_(in_files() && access == Access::write) {}

std::filesystem::path KeyframeStore::file(std::size_t keyframe, const char* name) const {
  return file_of(files_, keyframe, name);
}

void KeyframeStore::put(std::size_t keyframe, const Frame& frame, Features features) {
  put(keyframe, frame, ready(std::move(features)));
}

void KeyframeStore::put(std::size_t keyframe, const Frame& frame, FutureFeatures features) {
  const auto lock = wait_and_lock();
  cache(keyframe, features);
  writing_ =
      std::async(std::launch::async, [this, keyframe, depth = frame.depth, color = frame.color, features]() mutable {
        Packed packed;
        packed.corners = bytes_of(*features_or_none(features));
        packed_.erase(keyframe);
        try {
          if (!rig_.color) depth = marked_depth(std::move(depth), color);
          packed.depth = encode_depth(depth, rig_.depth, kDepthStepsPerMeter);
          if (!color.empty()) packed.color = encode_color(color, rig_.color_view(), ".jpg");
          if (is_writable_) return write(keyframe, packed);
        } catch (const std::exception&) {
          // Stays in memory until store().
        }
        packed_[keyframe] = std::move(packed);
      });
}

void KeyframeStore::correct(std::size_t keyframe, const DepthCorrection& correction) {
  if (files_.is_elsewhere(keyframe))
    throw std::runtime_error(file(keyframe, kDepth).string() + ": belongs to another map and is read-only");
  Frame frame = get(keyframe);
  correction.apply(rig_.depth.width, rig_.depth.height, frame.depth);
  const std::vector<float> depth = rig_.color ? frame.depth : marked_depth(std::move(frame.depth), frame.color);
  auto packed = encode_depth(depth, rig_.depth, kDepthStepsPerMeter);
  const auto lock = wait_and_lock();
  if (const auto packed_it = packed_.find(keyframe); packed_it != packed_.end())
    packed_it->second.depth = std::move(packed);
  else
    write_whole(file(keyframe, kDepth), packed, Durable::some_time);
}

void KeyframeStore::write(std::size_t keyframe, const Packed& packed) const {
  // Not synced here: a checkpoint syncs all files at once, see SessionWriter.
  write_whole(file(keyframe, kDepth), packed.depth, Durable::some_time);
  if (!packed.color.empty()) write_whole(file(keyframe, kColor), packed.color, Durable::some_time);
  write_whole(file(keyframe, kCorners), packed.corners, Durable::some_time);
}

void KeyframeStore::copy(std::size_t keyframe, const KeyframeStore& from, std::size_t from_keyframe) const {
  wait();
  from.wait();
  for (const char* name : {kDepth, kCorners, kColor})
    if (std::filesystem::exists(from.file(from_keyframe, name)))
      write_whole(file(keyframe, name), read_bytes(from.file(from_keyframe, name)), Durable::some_time);
}

std::unique_lock<std::mutex> KeyframeStore::wait_and_lock() const {
  std::unique_lock lock(mutex_);
  if (writing_.valid()) writing_.get();
  return lock;
}

void KeyframeStore::wait() const { (void)wait_and_lock(); }

std::optional<std::string> KeyframeStore::store() {
  const auto lock = wait_and_lock();
  if (!is_writable_) return std::nullopt;
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

std::vector<std::uint8_t> KeyframeStore::stored_bytes(std::size_t keyframe, std::vector<std::uint8_t> Packed::*part,
                                                      const char* name) const {
  {
    const auto lock = wait_and_lock();
    if (const auto found = packed_.find(keyframe); found != packed_.end()) return found->second.*part;
  }
  return read_bytes(file(keyframe, name));
}

std::shared_ptr<const Features> KeyframeStore::features(std::size_t keyframe) const {
  if (auto features = cached(keyframe)) return features;
  const auto bytes = stored_bytes(keyframe, &Packed::corners, kCorners);
  if (bytes.empty() || bytes.size() % sizeof(StoredFeature) != 1)
    throw std::runtime_error(file(keyframe, kCorners).string() + ": is missing or broken; " + kRemedy);
  const FutureFeatures features = ready(features_in(bytes));
  cache(keyframe, features);
  return features.get();
}

void KeyframeStore::cache(std::size_t keyframe, FutureFeatures features) const {
  const std::lock_guard lock(cache_mutex_);
  cache_[keyframe] = {std::move(features), ++use_};
  if (cache_.size() <= kMaxCachedFeatures) return;
  cache_.erase(std::min_element(cache_.begin(), cache_.end(),
                                [](const auto& a, const auto& b) { return a.second.last_use < b.second.last_use; }));
}

std::shared_ptr<const Features> KeyframeStore::cached(std::size_t keyframe) const {
  FutureFeatures features;
  {
    const std::lock_guard lock(cache_mutex_);
    const auto found = cache_.find(keyframe);
    if (found == cache_.end()) return nullptr;
    found->second.last_use = ++use_;
    features = found->second.features;
  }
  return features_or_none(features);
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

std::vector<float> meters_of(const cv::Mat& steps) {
  std::vector<float> meters(steps.total());
  cv::Mat depth(steps.rows, steps.cols, CV_32F, meters.data());
  steps.convertTo(depth, CV_32F, 1 / kDepthStepsPerMeter);
  depth.setTo(0, steps == kMaskedSteps);
  return meters;
}

/// Depth image as stored, 16 bits. Throws std::runtime_error naming the file if the bytes are broken.
cv::Mat depth_steps(const std::vector<std::uint8_t>& bytes, const Camera& camera, const std::filesystem::path& file) {
  cv::Mat steps = decoded(bytes, Pixels::as_stored, camera);
  if (steps.type() != CV_16U || steps.empty())
    throw std::runtime_error(file.string() + ": is missing or broken; " + kRemedy);
  return steps;
}

}  // namespace

std::vector<float> KeyframeStore::depth(std::size_t keyframe) const {
  return meters_of(depth_steps(stored_bytes(keyframe, &Packed::depth, kDepth), rig_.depth, file(keyframe, kDepth)));
}

Frame KeyframeStore::get(std::size_t keyframe) const {
  Frame frame;
  const cv::Mat steps = depth_steps(stored_bytes(keyframe, &Packed::depth, kDepth), rig_.depth, file(keyframe, kDepth));
  frame.depth = meters_of(steps);
  const cv::Mat rgba = decoded(stored_bytes(keyframe, &Packed::color, kColor), Pixels::rgba, rig_.color_view());
  if (!rgba.empty()) frame.color = color_pixels(rgba);
  if (!rig_.color)
    for (std::size_t i = 0; i < frame.color.size(); ++i)
      if (steps.ptr<std::uint16_t>()[i] == kMaskedSteps) frame.color[i] &= 0x00ffffffu;
  return frame;
}

}  // namespace cairn
