// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A session: a folder from which a run goes on. `state.cbor` is written last and at once, and names what else belongs
// to it: `keyframes/` (images and corners), `submap-N.vdb`, and `active-N.vdb`, the volume that is being fused into.
#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "map/back_end.hpp"
#include "track/tracker.hpp"

namespace cairn {

struct Session {
  Camera camera;
  FuseOptions fuse;
  float min_depth = 0, max_depth = 0;  // metres, see SurfaceOptions
  BackEnd::Memory back_end;
  Tracker::Memory tracker;
  PhotometricKeyframe::Saved keyframe;
  Volume::Residency residency;
  std::uint32_t stamp = 0;
  std::size_t last_image = 0;
  int repeats = 0, lost = 0;
  std::optional<double> last_fused;
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
  std::uint64_t number = 0;  // of the checkpoint
  std::string note;          // of whoever drives the mapper
};

/// Writes the volume's bricks and then the state, each whole or not at all; a kill at any moment leaves the session
/// before or this one. Files that no longer belong to it are removed.
void write_session(const std::filesystem::path& folder, const Session& session, const BrickTree& active);

struct ReadSession {
  Session session;
  BrickTree active;
};
/// Throws std::runtime_error with what is wrong and what to do: nothing there, damaged, written by another version.
[[nodiscard]] ReadSession read_session(const std::filesystem::path& folder);

}  // namespace cairn
