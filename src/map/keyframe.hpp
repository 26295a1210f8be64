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

#include "cairn/frame.hpp"
#include "cairn/pose.hpp"
#include "map/numbered_files.hpp"
#include "map/structure.hpp"
#include "place/features.hpp"

namespace cairn {

/// A frame that the map remembers: a node of the pose graph.
struct Keyframe {
  int frame = 0;             // index in its recording
  double timestamp = 0.0;    // seconds
  double colour_delay = 0;   // see Frame
  std::size_t submap = 0;    // that it was fused into
  std::size_t searched = 0;  // so many of the keyframes before it were looked through for its place
  bool follows = false;      // how it lies to the keyframe before it was tracked; not so for the first of a piece
  Eigen::Isometry3d odometry_from_camera = Eigen::Isometry3d::Identity();  // as tracked
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();    // as fused: the same, until fused again
  Matrix6d information = Matrix6d::Zero();      // of that, in the camera's frame; 1/rad^2, 1/m^2
  std::optional<Eigen::Vector3d> acceleration;  // see Frame
  /// Of the frames since, in this one's camera frame, m/s^2: the sum as a vector, and of the lengths.
  Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();
  Structure structure;  // where what it shows faces
};

/// Whether a camera has moved far enough for another keyframe, or `times` as far.
[[nodiscard]] bool is_apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double times = 1);

/// What a session's folder is open for.
enum class Access { write, read };

/// Its colour image in a store's files; there is none of a frame without colour.
[[nodiscard]] std::filesystem::path colour_file(const NumberedFiles& files, std::size_t keyframe);

/// The keyframes' images, compressed (depth: PNG of 0.2 mm steps; colour: JPEG), and corners, in files of a folder or,
/// without one, in memory. May be read by several threads while one puts.
class KeyframeStore {
 public:
  /// Without the right to write, what is put stays in memory.
  KeyframeStore(const Rig& rig, NumberedFiles files, Access access = Access::write);
  /// Compresses and writes in a thread of its own. `keyframe` counts up, or goes back to write again. What cannot be
  /// written stays in memory; store() tries again.
  void put(std::size_t keyframe, const Frame& frame, Features features);
  /// Corrects the depth that is kept, but never another map's: throws std::runtime_error.
  void correct(std::size_t keyframe, const DepthCorrection& correction);
  [[nodiscard]] bool in_files() const { return !files_.folder().empty(); }
  /// Copies another store's keyframe. Both must have folders.
  void copy(std::size_t keyframe, const KeyframeStore& from, std::size_t its) const;
  /// Depth alone, metres, as it was kept. Throws like get().
  [[nodiscard]] std::vector<float> depth(std::size_t keyframe) const;
  /// Depth and colour as they were kept. Throws std::runtime_error naming the file if it is lost.
  [[nodiscard]] Frame get(std::size_t keyframe) const;
  /// The last ones that were put or asked for stay in memory. Throws std::runtime_error naming the file if it is lost.
  [[nodiscard]] std::shared_ptr<const Features> features(std::size_t keyframe) const;
  /// Waits until what was put is kept.
  void wait() const;
  /// Brings all that was put into files. Returns why some could not be written, or nothing.
  [[nodiscard]] std::optional<std::string> store();

 private:
  struct Packed {
    std::vector<std::uint8_t> depth, colour, corners;
  };
  struct Recent {
    std::shared_ptr<const Features> features;
    std::uint64_t last_use = 0;
  };
  void write(std::size_t keyframe, const Packed& packed) const;
  [[nodiscard]] std::filesystem::path file(std::size_t keyframe, const char* what) const;
  /// Nothing is being written, and nothing begins to be as long as the lock is held.
  [[nodiscard]] std::unique_lock<std::mutex> quiet() const;
  /// What is kept of it in memory, or else in files, if it is.
  [[nodiscard]] std::vector<std::uint8_t> kept(std::size_t keyframe, std::vector<std::uint8_t> Packed::*part,
                                               const char* what) const;
  void remember(std::size_t keyframe, std::shared_ptr<const Features> features) const;
  [[nodiscard]] std::shared_ptr<const Features> remembered(std::size_t keyframe) const;
  Rig rig_;
  NumberedFiles files_;
  bool writes_;
  std::map<std::size_t, Packed> packed_;  // what is not in files
  mutable std::future<void> writing_;     // it alone changes packed_ meanwhile
  mutable std::mutex mutex_;              // of these two
  mutable std::map<std::size_t, Recent> recent_;
  mutable std::uint64_t use_ = 0;
  mutable std::mutex recent_mutex_;  // of these two
};

}  // namespace cairn
