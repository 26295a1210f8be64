// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image folders of every layout. The input contains the text files in sequence, each after a line of `@` and its name.
#include <array>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/source.hpp"
#include "fuzz.hpp"
#include "io/recording.hpp"

using namespace cairn;

namespace {

namespace fs = std::filesystem;
constexpr std::array kFiles{"depth.txt",       "rgb.txt",           "camera.yaml",     "accelerometer.txt",
                            "groundtruth.txt", "associations.txt",  "intrinsics.json", "frame-000000.pose.txt",
                            "calibration.txt", "transforms.json",   "intrinsic.json",  "calibration.yaml",
                            "poses.txt",       "traj.txt",          "cam_params.json", "rgb.mp4",
                            "odometry.csv",    "camera_matrix.csv", "imu.csv",         "intrinsics.txt",
                            "calib.yaml"};

fs::path recording() {
  static const fs::path made = [] {
    auto folder = fuzz::folder() / "recording";
    fs::create_directories(folder / "depth");
    fs::create_directories(folder / "rgb");
    fs::create_directories(folder / "results");
    cv::imwrite(folder / "results/depth000000.png", cv::Mat(16, 16, CV_16U, cv::Scalar(1000)));
    cv::imwrite(folder / "depth/1.png", cv::Mat(16, 16, CV_16U, cv::Scalar(1000)));
    cv::imwrite(folder / "depth/2.png", cv::Mat(16, 16, CV_16U, cv::Scalar(2000)));
    fs::create_directories(folder / "confidence");
    cv::imwrite(folder / "depth/000000.png", cv::Mat(16, 16, CV_16U, cv::Scalar(1000)));
    cv::imwrite(folder / "depth/000001.png", cv::Mat(16, 16, CV_16U, cv::Scalar(1000)));
    cv::imwrite(folder / "confidence/000001.png", cv::Mat(16, 16, CV_8U, cv::Scalar(1)));
    for (const char* name : {"rgb/1.png", "rgb/2.png"})
      cv::imwrite(folder / name, cv::Mat(16, 16, CV_8UC3, cv::Scalar(1, 2, 3)));
    return folder;
  }();
  return made;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fs::path folder = recording();
  std::error_code ignored;
  for (const char* name : kFiles) fs::remove(folder / name, ignored);
  fs::remove(folder / "frame-000000.depth.png", ignored);
  for (std::string_view rest = fuzz::text_of(data, size); !rest.empty();) {
    const std::string_view name = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), name.size() + 1));
    const std::size_t end = rest.starts_with('@') ? 0 : std::min(rest.find("\n@"), rest.size() - 1) + 1;
    for (const char* known : kFiles)
      if (name.starts_with('@') && name.substr(1) == known) {
        fuzz::file_of(std::string("recording/") + known, rest.substr(0, end));
        if (name.ends_with("pose.txt"))
          fs::copy_file(folder / "depth/1.png", folder / "frame-000000.depth.png",
                        fs::copy_options::overwrite_existing);
      }
    rest.remove_prefix(std::min(end, rest.size()));
  }
  fuzz::expect_value_or_plain_error([&] {
    const auto source = open_recording(folder);
    for (int i = 0; i < 4; ++i)
      if (const auto frame = source->next()) {
        fuzz::touch(frame->depth);
        fuzz::touch(frame->color);
      }
    for (const auto& pose : recorded_truth(folder))
      if (!pose.world_from_camera.matrix().allFinite()) std::abort();
  });
  return 0;
}
