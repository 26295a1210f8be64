// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/trajectory.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("trajectory.txt", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const Trajectory trajectory = read_trajectory(file);
    for (const StampedPose& pose : trajectory) {
      if (!pose.world_from_camera.matrix().allFinite()) std::abort();
      (void)pose_at(trajectory, pose.timestamp + 0.01, 0.1);
    }
  });
  return 0;
}
