// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ScanNet .sens file (Dai et al. 2017), version 4, little-endian: a header with both cameras, then the frames; depth
// compressed with zlib, color as JPEG.
#include <zlib.h>

#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include "base/image_file.hpp"
#include "geometry/encode_frame.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written in memory byte order");
constexpr double kUnits = 1000;  // per meter
constexpr std::string_view kSensor = "StructureSensor";

class SensWriter final : public LayoutWriter {
 public:
  SensWriter(const std::filesystem::path& folder, const Rig& rig)
      : rig_(rig), name_(folder / "recording.sens"), out_(name_, std::ios::binary) {
    const Camera &color = rig.color_view(), &depth = rig.depth;
    put(std::uint32_t{4});  // version
    put(std::uint64_t{kSensor.size()});
    out_ << kSensor;
    put_intrinsic(color);
    put_pose(rig.depth_from_color());
    put_intrinsic(depth);
    put_pose(Eigen::Isometry3d::Identity());
    put(std::int32_t{2});  // color: JPEG
    put(std::int32_t{1});  // depth: zlib
    for (const int pixels : {color.width, color.height, depth.width, depth.height})
      put(static_cast<std::uint32_t>(pixels));
    put(static_cast<float>(kUnits));
    count_at_ = out_.tellp();
    put(count_);
    check_written();
  }
  void add(const Frame& frame) override {
    const auto microseconds = [](double seconds) { return static_cast<std::uint64_t>(std::llround(1e6 * seconds)); };
    const auto color =
        frame.color.empty() ? std::vector<std::uint8_t>{} : encode_color(frame.color, rig_.color_view(), ".jpg");
    const auto depth = compressed(frame.depth);
    put_pose(frame.world_from_camera.value());
    put(microseconds(frame.timestamp + frame.color_delay));
    put(microseconds(frame.timestamp));
    put(std::uint64_t{color.size()});
    put(std::uint64_t{depth.size()});
    put_bytes(color);
    put_bytes(depth);
    ++count_;
    check_written();
  }
  void finish() override {
    put(std::uint64_t{0});  // number of inertial frames
    out_.seekp(count_at_);
    put(count_);
    out_.flush();
    check_written();
  }

 private:
  template <class T>
  void put(const T& value) {
    out_.write(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void put_bytes(const std::vector<std::uint8_t>& bytes) {
    out_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  void put_pose(const Eigen::Isometry3d& pose) {
    const Eigen::Matrix<float, 4, 4, Eigen::RowMajor> rows = pose.matrix().cast<float>();
    out_.write(reinterpret_cast<const char*>(rows.data()), sizeof(float) * 16);
  }
  void put_intrinsic(const Camera& c) {
    Eigen::Isometry3d k = Eigen::Isometry3d::Identity();
    k.linear() << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
    put_pose(k);
  }
  [[nodiscard]] static std::vector<std::uint8_t> compressed(const std::vector<float>& depth) {
    const auto units = depth_units(depth, kUnits);
    auto size = compressBound(2 * units.size());
    std::vector<std::uint8_t> bytes(size);
    if (compress(bytes.data(), &size, reinterpret_cast<const Bytef*>(units.data()), 2 * units.size()) != Z_OK)
      throw std::runtime_error("zlib cannot compress a depth image");
    bytes.resize(size);
    return bytes;
  }
  void check_written() {
    if (!out_) throw std::runtime_error("cannot write " + name_.string() + ": is the disk full?");
  }

  Rig rig_;
  std::filesystem::path name_;
  std::ofstream out_;
  std::streampos count_at_;
  std::uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_sens(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<SensWriter>(folder, rig);
}

}  // namespace cairn
