// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Writers of folder layouts, each following the specification of its programs or data set. `folder` must be empty. The
// caller has checked that the layout can represent the rig.
#pragma once
#include "cairn/io/layouts.hpp"

namespace cairn {

/// TUM RGB-D with camera.yaml; Bonn's folders have no camera file, ETH3D's have calibration.txt.
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

/// Image output shared by the writers.
class ImageFolder {
 public:
  ImageFolder(std::filesystem::path folder, const Rig& rig) : folder_(std::move(folder)), rig_(rig) {}
  /// Writes a PNG, with the value `none` for missing measurements.
  void write_depth(const std::string& name, const Frame& frame, double units_per_meter, std::uint16_t none = 0) const;
  /// Writes in the format of the name's extension; skips frames without color.
  void write_color(const std::string& name, const Frame& frame) const;
  void write_text(const std::string& name, std::string_view text) const;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Camera& camera() const { return rig_.depth; }

 private:
  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const;
  std::filesystem::path folder_;
  Rig rig_;
};

/// Formats a matrix row by row, with up to 17 digits.
[[nodiscard]] std::string rows_of(const Eigen::Isometry3d& pose, int rows, std::string_view separator);

}  // namespace cairn
