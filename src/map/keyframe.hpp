// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/pose.hpp"
#include "geometry/device_drift.hpp"
#include "gravity/structure.hpp"
#include "inertial/inertial_keyframe.hpp"
#include "map/numbered_files.hpp"
#include "place/features.hpp"

namespace cairn {

/// Node of the pose graph: a frame stored in the map.
struct Keyframe {
  int frame = 0;             // index in its recording
  double timestamp = 0.0;    // seconds
  double color_delay = 0;    // see Frame
  std::size_t submap = 0;    // submap it was fused into
  std::size_t searched = 0;  // number of earlier keyframes searched for loop closures
  bool follows = false;  // true if tracked continuously from the preceding keyframe; false for the first of a component
  Eigen::Isometry3d odometry_from_camera = Eigen::Isometry3d::Identity();  // as tracked
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();    // as fused; differs after re-integration
  Matrix6d information = Matrix6d::Zero();       // of odometry_from_camera, in the camera's frame; 1/rad^2, 1/m^2
  std::optional<Eigen::Vector3d> acceleration;   // see Frame
  std::optional<Eigen::Isometry3d> device_pose;  // Frame::guess, in the device's own world
  std::optional<DeviceDrift> device_drift;       // none: device_pose is no measurement
  /// Accelerations of the frames since, in this keyframe's camera frame, m/s^2: sum of the vectors, and sum of their
  /// norms.
  Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();
  Structure structure;        // surface orientations in the depth image
  InertialKeyframe inertial;  // by a gyroscope and an accelerometer
};

/// True if the motion between two camera poses exceeds the keyframe distance, multiplied by `factor`.
[[nodiscard]] bool exceeds_keyframe_distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double factor = 1);

/// Access to a session's folder.
enum class Access { write, read };

/// Color image of a keyframe in a store's files; frames without color have none.
[[nodiscard]] std::filesystem::path color_file(const NumberedFiles& files, std::size_t keyframe);

/// Keyframe images, compressed (depth: PNG in steps of 0.2 mm; color: JPEG), and features; in files of a folder or,
/// without a folder, in memory. Several threads may read while one thread puts.
class KeyframeStore {
 public:
  /// Without write access, added keyframes stay in memory.
  KeyframeStore(const Rig& rig, NumberedFiles files, Access access = Access::write);
  /// Compresses and writes in a background thread. `keyframe` counts up, or is an existing index to overwrite. Data
  /// that cannot be written stays in memory; store() tries again.
  void put(std::size_t keyframe, const Frame& frame, FutureFeatures features);
  void put(std::size_t keyframe, const Frame& frame, Features features);
  /// Corrects the stored depth. Throws std::runtime_error for a keyframe of another map, whose files are read-only.
  void correct(std::size_t keyframe, const DepthCorrection& correction);
  /// Copies another store's keyframe. Both must have folders.
  void copy(std::size_t keyframe, const KeyframeStore& from, std::size_t from_keyframe) const;
  [[nodiscard]] bool in_files() const { return !files_.folder().empty(); }
  /// Stored depth alone, meters. Throws like get().
  [[nodiscard]] std::vector<float> depth(std::size_t keyframe) const;
  /// Stored depth and color. Throws std::runtime_error naming the file if it is missing or broken.
  [[nodiscard]] Frame get(std::size_t keyframe) const;
  /// Features; the most recently used ones are cached in memory. Throws std::runtime_error naming the file if it is
  /// missing or broken.
  [[nodiscard]] std::shared_ptr<const Features> features(std::size_t keyframe) const;
  /// Waits until the last put() is complete.
  void wait() const;
  /// Writes all keyframes still in memory to files. Returns the reason if some could not be written.
  [[nodiscard]] std::optional<std::string> store();

 private:
  struct Packed {
    std::vector<std::uint8_t> depth, color, corners;
  };
  struct CacheEntry {
    FutureFeatures features;
    std::uint64_t last_use = 0;
  };
  void write(std::size_t keyframe, const Packed& packed) const;
  [[nodiscard]] std::filesystem::path file(std::size_t keyframe, const char* name) const;
  /// Waits for the background write. No new write starts while the lock is held.
  [[nodiscard]] std::unique_lock<std::mutex> wait_and_lock() const;
  /// Stored bytes from memory, or else from a file; empty if missing.
  [[nodiscard]] std::vector<std::uint8_t> stored_bytes(std::size_t keyframe, std::vector<std::uint8_t> Packed::*part,
                                                       const char* name) const;
  void cache(std::size_t keyframe, FutureFeatures features) const;
  [[nodiscard]] std::shared_ptr<const Features> cached(std::size_t keyframe) const;
  Rig rig_;
  NumberedFiles files_;
  bool is_writable_;
  std::map<std::size_t, Packed> packed_;  // not in files
  mutable std::future<void> writing_;     // the only writer of packed_ while running
  mutable std::mutex mutex_;              // guards packed_ and writing_
  mutable std::map<std::size_t, CacheEntry> cache_;
  mutable std::uint64_t use_ = 0;
  mutable std::mutex cache_mutex_;  // guards cache_ and use_
};

}  // namespace cairn
