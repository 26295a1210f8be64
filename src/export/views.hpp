// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images with poses, for programs that learn a scene from them.
#pragma once
#include <memory>

#include "cairn/export.hpp"
#include "cairn/layouts.hpp"
#include "texture/views.hpp"

namespace cairn {

/// What `write_views` finds in its folder.
inline constexpr const char* kViewPoints = "points.ply";

struct ViewsInput {
  Rig rig;
  std::vector<TextureKeyframe> keyframes;
  TextureViews::GetImage get_image;
  Eigen::Isometry3d world_from_map = Eigen::Isometry3d::Identity();  // to the world in which poses are written
};

/// Returns how many images were written into `folder`, which holds the points. Throws std::runtime_error if there are
/// none.
int write_views(const ViewsInput& input, const std::filesystem::path& folder, const ViewsOptions& options,
                const ExportProgress& progress);

/// Frames as COLMAP's text model (Schoenberger & Frahm 2016), with the points.
[[nodiscard]] std::unique_ptr<LayoutWriter> write_colmap(const std::filesystem::path& folder, const Camera& camera);

}  // namespace cairn
