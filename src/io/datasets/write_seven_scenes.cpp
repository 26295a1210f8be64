// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// 7-Scenes (Shotton et al. 2013): one sequence.
#include <fmt/format.h>

#include "cairn/io/known_cameras.hpp"
#include "io/camera_file.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

class SevenScenesWriter final : public LayoutWriter {
 public:
  SevenScenesWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {}
  void add(const Frame& frame) override {
    const auto name = [&](const char* what) { return fmt::format("frame-{:06}.{}", count_, what); };
    constexpr std::uint16_t kNone = 65535;
    files_.write_depth(name("depth.png"), frame, 1000, kNone);
    files_.write_color(name("color.png"), frame);
    const std::string rows = rows_of(frame.world_from_camera.value(), 4, "\t ");
    files_.write_text(name("pose.txt"), rows + "\n");
    ++count_;
  }
  /// The data set's Kinect camera is known, including its shutter; camera.yaml is written for any other camera.
  void finish() override {
    if (files_.camera() != known_camera("seven-scenes")->camera)
      files_.write_text("camera.yaml", camera_file_text({.rig = files_.rig()}));
  }

 private:
  ImageFolder files_;
  int count_ = 0;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_seven_scenes(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<SevenScenesWriter>(folder, rig);
}

}  // namespace cairn
