// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/gravity_alignment.hpp"

#include <array>
#include <stdexcept>
#include <utility>

namespace cairn {
namespace {

constexpr std::array<std::string_view, 8> kUps{"auto", "camera", "x", "y", "z", "-x", "-y", "-z"};  // indexed by Up
constexpr std::array<std::string_view, 5> kSources{"accelerometer", "structure", "option", "poses", "unknown"};

}  // namespace

Up parse_up(std::string_view name) {
  for (std::size_t i = 0; i < kUps.size(); ++i)
    if (name == kUps[i]) return static_cast<Up>(i);
  throw std::runtime_error("unknown up axis '" + std::string(name) + "'; expected auto, camera, x, y, z, -x, -y or -z");
}

std::string_view to_string(Up up) { return kUps[static_cast<std::size_t>(up)]; }

std::string_view to_string(GravityAlignment::Source source) { return kSources[static_cast<std::size_t>(source)]; }

}  // namespace cairn
