// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The writers of layouts, each from the description of its programs or data set. `folder` is empty; that the rig can be
// told in the layout was seen to before.
#pragma once
#include "cairn/layouts.hpp"

namespace cairn {

/// TUM RGB-D; without `camera_file` as Bonn's and ETH3D's, whose folders have calibration.txt or nothing.
enum class TumKind { cairn, bonn, eth3d };
[[nodiscard]] std::unique_ptr<LayoutWriter> write_tum(const std::filesystem::path& folder, const Rig& rig,
                                                      TumKind kind);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_seven_scenes(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_icl_nuim(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_replica(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_open3d(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_rtabmap(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_nerfstudio(const std::filesystem::path& folder, const Rig& rig);
[[nodiscard]] std::unique_ptr<LayoutWriter> write_sens(const std::filesystem::path& folder, const Rig& rig);

[[nodiscard]] std::unique_ptr<LayoutWriter> write_stray_scanner(const std::filesystem::path& folder, const Rig& rig);

/// What writers of images share.
class ImageFolder {
 public:
  ImageFolder(std::filesystem::path folder, const Rig& rig) : folder_(std::move(folder)), rig_(rig) {}
  /// A PNG; `none` where nothing was measured.
  void write_depth(const std::string& name, const Frame& frame, double units_per_metre, std::uint16_t none = 0) const;
  /// By the name's extension; nothing for a frame without colour.
  void write_colour(const std::string& name, const Frame& frame) const;
  void write_text(const std::string& name, std::string_view text) const;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Camera& camera() const { return rig_.depth; }

 private:
  [[nodiscard]] std::filesystem::path place(const std::string& name) const;
  std::filesystem::path folder_;
  Rig rig_;
};

/// The numbers of a matrix row by row, 17 digits where they need them.
[[nodiscard]] std::string rows_of(const Eigen::Isometry3d& pose, int rows, std::string_view between);

}  // namespace cairn
