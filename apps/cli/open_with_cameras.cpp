// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/open_with_cameras.hpp"

#include "cairn/mapping/rig.hpp"

namespace cairn::apps {

std::unique_ptr<Source> open_with_cameras(const std::string& recording, const std::filesystem::path& camera_file) {
  if (is_synthetic(recording) || !std::filesystem::exists(camera_file)) return open_source(recording);
  auto source = open_source(recording, {.find_color_camera = false});
  const Rig rig = read_rig(camera_file);
  if (rig.has_same_cameras(source->rig()) && rig.depth_correction == source->rig().depth_correction) return source;
  return open_source(recording, {.camera = camera_file});
}

}  // namespace cairn::apps
