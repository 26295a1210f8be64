// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images with poses, for programs that learn a scene from images.
#pragma once
#include <memory>

#include "cairn/io/layouts.hpp"
#include "cairn/mapping/export.hpp"
#include "texture/views.hpp"

namespace cairn {

/// File in the folder of `write_views`.
inline constexpr const char* kViewPoints = "points.ply";

struct ViewsInput {
  Rig rig;
  std::vector<TextureKeyframe> keyframes;
  TextureViews::GetImage get_image;
  Eigen::Isometry3d world_from_map = Eigen::Isometry3d::Identity();  // to the world of the written poses
};

/// Variance of the Laplacian (Pech-Pacheco et al. 2000) of a color image; less than 0 without color.
[[nodiscard]] double sharpness_of(Frame& frame, const Camera& camera);

/// Returns the number of images written into `folder`, which contains the points. Throws std::runtime_error for zero
/// images.
int write_views(const ViewsInput& input, const std::filesystem::path& folder, const ViewsOptions& options,
                const ExportProgress& progress);

/// Frames as COLMAP's text model (Schoenberger & Frahm 2016), with the points.
[[nodiscard]] std::unique_ptr<LayoutWriter> write_colmap(const std::filesystem::path& folder, const Camera& camera);

}  // namespace cairn
