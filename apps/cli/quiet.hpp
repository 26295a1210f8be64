// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <spdlog/spdlog.h>

#include <algorithm>

namespace cairn::apps {

/// Suppresses warnings during a preliminary read; the regular read of the recording repeats them.
class Quiet {
 public:
  Quiet() { spdlog::set_level(std::max(level_, spdlog::level::err)); }
  ~Quiet() { spdlog::set_level(level_); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  spdlog::level::level_enum level_ = spdlog::get_level();
};

}  // namespace cairn::apps
