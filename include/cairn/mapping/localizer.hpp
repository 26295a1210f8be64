// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/building/change.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"

namespace cairn {

struct LocalizerOptions {
  TrackOptions track;
  MotionOptions motion;
  bool changes = false;  ///< fuses localized frames in a volume of their own, for Localizer::export_changes
};

/// Pose of a frame in a map.
struct LocalizedFrame {
  int index = 0;           ///< Frame::index
  double timestamp = 0.0;  ///< seconds, of the depth image
  /// Pose of the depth camera in the exported world frame of the map, the frame of Map::trajectory and of exported
  /// grids. Empty if no pose was confirmed by the map's surface.
  std::optional<Eigen::Isometry3d> world_from_camera;
  /// Covariance of this pose, see FrameReport::covariance. It excludes errors of the map.
  std::optional<Matrix6d> covariance;
  FrameCause cause = FrameCause::none;      ///< reason for a missing pose
  std::string reason;                       ///< text of the cause, with the measured value
  AlignmentFit fit;                         ///< all 0 without an alignment
  InitialGuess guess = InitialGuess::none;  ///< `relocalized`: found by place recognition
  double milliseconds = 0.0;                ///< time of Localizer::add
};

/// Localizes frames in the map of a saved session, which stays unchanged: place recognition finds the first pose and
/// poses after a tracking loss, then each frame is aligned with the map's surface.
///
///   cairn::Localizer localizer("out/desk", source->rig());
///   while (auto frame = source->next())
///     if (auto pose = localizer.add(*frame).world_from_camera) drive(*pose);
///
/// Not thread-safe: use from one thread at a time.
class Localizer {
 public:
  /// `map`: folder of `cairn reconstruct`, `live`, `merge` or `optimize`, as of its last checkpoint. `rig`: of the
  /// frames; the cameras may differ from the map's. Loads the largest component of the map. `device`: index of
  /// list_devices; -1 chooses. Throws std::runtime_error with the missing or damaged file and the remedy.
  Localizer(const std::filesystem::path& map, const Rig& rig, const LocalizerOptions& options = {}, int device = -1);
  ~Localizer();
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;

  /// Localizes the next frame. Throws std::runtime_error only if the device fails.
  LocalizedFrame add(const Frame& frame);
  /// Starts another recording: its first frame may be anywhere in the map, at any time.
  void begin_recording();

  /// With LocalizerOptions::changes: as cairn::export_change, from the map to the surface seen by the localized frames.
  /// Throws std::runtime_error if no frame was localized.
  ExportedChange export_changes(const std::filesystem::path& file, const ChangeOptions& options = {},
                                const ExportProgress& progress = {});

  /// Gravity alignment of the map, see Mapper::upright.
  [[nodiscard]] const GravityAlignment& upright() const;
  /// Parts of the map that could not be loaded, one line each.
  [[nodiscard]] const std::vector<std::string>& warnings() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
