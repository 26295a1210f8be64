// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// nerfstudio's transforms.json (Tancik et al. 2023). Poses use the OpenGL camera: x right, y up, z back. The center of
// the upper left pixel is (0.5, 0.5).
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/json_text.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

constexpr const char* kPoints = "points.ply";  // referenced in the JSON file if present

class NerfstudioWriter final : public LayoutWriter {
 public:
  NerfstudioWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {
    const auto& d = rig.depth.distortion;
    if (rig.depth.lens == Lens::brown_conrady && (d[5] != 0 || d[6] != 0 || d[7] != 0))
      throw std::runtime_error("the layout nerfstudio cannot store a lens with k4, k5 and k6: rectify the images");
  }
  void add(const Frame& frame) override {
    const std::string name = fmt::format("frame_{:05}", frames_.size() + 1);
    files_.write_depth("depths/" + name + ".png", frame, 1000);
    files_.write_color("images/" + name + ".jpg", frame);
    Eigen::Isometry3d pose = frame.world_from_camera.value();
    pose.linear().rightCols<2>() *= -1;  // half a turn about x
    nlohmann::json rows = nlohmann::json::array();
    for (int r = 0; r < 4; ++r) {
      const Eigen::RowVector4d row = pose.matrix().row(r);
      rows.push_back({row[0], row[1], row[2], row[3]});
    }
    nlohmann::json entry{{"depth_file_path", "depths/" + name + ".png"}, {"transform_matrix", rows}};
    if (!frame.color.empty()) entry["file_path"] = "images/" + name + ".jpg";
    frames_.push_back(std::move(entry));
  }
  void finish() override {
    const Camera& c = files_.camera();
    nlohmann::json all{{"camera_model", c.lens == Lens::fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
                       {"w", c.width},
                       {"h", c.height},
                       {"fl_x", c.fx},
                       {"fl_y", c.fy},
                       {"cx", c.cx + 0.5},
                       {"cy", c.cy + 0.5},
                       {"depth_unit_scale_factor", 1e-3},
                       {"frames", std::move(frames_)}};
    const auto names =
        c.lens == Lens::fisheye ? std::array{"k1", "k2", "k3", "k4", ""} : std::array{"k1", "k2", "p1", "p2", "k3"};
    for (std::size_t i = 0; i < names.size(); ++i)
      if (*names[i] != 0) all[names[i]] = c.distortion[i];
    if (std::filesystem::exists(files_.folder() / kPoints)) all["ply_file_path"] = kPoints;
    files_.write_text("transforms.json", text_of(all, 2));
  }

 private:
  ImageFolder files_;
  nlohmann::json frames_ = nlohmann::json::array();
};

}  // namespace

std::unique_ptr<LayoutWriter> write_nerfstudio(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<NerfstudioWriter>(folder, rig);
}

}  // namespace cairn
