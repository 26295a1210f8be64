// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ROS recordings: .bag, .mcap and .db3 files, by their first bytes.
#include <spdlog/spdlog.h>

#include "fuzz.hpp"
#include "io/ros/ros_source.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  spdlog::set_level(spdlog::level::off);
  const auto bytes = fuzz::text_of(data, size);
  const char* name = bytes.starts_with('S') ? "a.db3" : bytes.starts_with('#') ? "a.bag" : "a.mcap";
  const auto file = fuzz::file_of(name, bytes);
  fuzz::expect_value_or_plain_error([&] {
    const auto source = open_ros(file, {});
    for (int i = 0; i < 4; ++i)
      if (const auto frame = source->next()) {
        fuzz::expect_value_or_plain_error([&] {
          if (frame->problem) throw std::runtime_error(*frame->problem);
        });
        for (const float z : frame->depth)
          if (!(z >= 0)) std::abort();
        fuzz::touch(frame->color);
        for (const auto& sample : frame->gyro)
          if (!sample.rate.allFinite()) std::abort();
        if (frame->acceleration && !frame->acceleration->allFinite()) std::abort();
      }
    if (const auto cut = source->ended_early()) throw std::runtime_error(*cut);
  });
  return 0;
}
