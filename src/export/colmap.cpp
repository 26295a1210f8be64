// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <fmt/ostream.h>

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "cairn/mapping/mesh.hpp"
#include "export/views.hpp"
#include "geometry/encode_frame.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class ColmapWriter final : public LayoutWriter {
 public:
  ColmapWriter(fs::path folder, const Camera& camera) : folder_(std::move(folder)), camera_(camera) {
    for (const char* name : {"images", "depths", "sparse/0"}) fs::create_directories(folder_ / name);
  }
  void add(const Frame& frame) override {
    const std::string name = fmt::format("frame_{:05}", ++count_);
    write_whole(folder_ / "images" / (name + ".jpg"), encode_color(frame.color, camera_, ".jpg"), Durable::some_time);
    write_whole(folder_ / "depths" / (name + ".png"), encode_depth(frame.depth, camera_, 1000), Durable::some_time);
    const Eigen::Isometry3d pose = frame.world_from_camera.value().inverse();
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d t = pose.translation();
    // The second line lists points observed in the image: none.
    images_ += fmt::format("{} {} {} {} {} {} {} {} 1 {}.jpg\n\n", count_, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(),
                           t.z(), name);
  }
  void finish() override {
    const Camera& c = camera_;
    const fs::path model = folder_ / "sparse/0";
    write_whole(model / "cameras.txt",  // the center of the upper left pixel is (0.5, 0.5)
                fmt::format("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 PINHOLE {} {} {} {} {} {}\n", c.width,
                            c.height, c.fx, c.fy, c.cx + 0.5, c.cy + 0.5));
    write_whole(
        model / "images.txt",
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n" + images_);
    const Mesh points = read_mesh(folder_ / kViewPoints);
    write_whole(model / "points3D.txt", [&](std::ostream& out) {
      out << "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
      for (std::size_t i = 0; i < points.positions.size(); ++i) {
        const auto& p = points.positions[i];
        const auto color = points.colors.empty() ? std::array<std::uint8_t, 4>{128, 128, 128, 255} : points.colors[i];
        fmt::print(out, "{} {} {} {} {} {} {} 0\n", i + 1, p.x(), p.y(), p.z(), color[0], color[1], color[2]);
      }
    });
    fs::remove(folder_ / kViewPoints);
  }

 private:
  fs::path folder_;
  Camera camera_;
  int count_ = 0;
  std::string images_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_colmap(const fs::path& folder, const Camera& camera) {
  return std::make_unique<ColmapWriter>(folder, camera);
}

}  // namespace cairn
