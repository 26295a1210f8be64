// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replaces azure_kinect.cpp, stray_scanner.cpp and write_stray_scanner.cpp in builds without FFmpeg.
#include <stdexcept>

#include "io/datasets/azure_kinect.hpp"
#include "io/layouts.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

std::runtime_error no_video(const std::filesystem::path& path) {
  return std::runtime_error(path.string() +
                            ": videos need FFmpeg, which this build lacks: build with CAIRN_VIDEO=ON, which needs "
                            "libavformat-dev and libswscale-dev");
}

}  // namespace

std::unique_ptr<Source> open_azure_kinect(const std::filesystem::path& file) { throw no_video(file); }

std::optional<Recording> read_stray_scanner(const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "rgb.mp4")) throw no_video(folder / "rgb.mp4");
  return std::nullopt;
}

std::unique_ptr<LayoutWriter> write_stray_scanner(const std::filesystem::path& folder, const Rig&) {
  throw no_video(folder / "rgb.mp4");
}

}  // namespace cairn
