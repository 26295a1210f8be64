// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "cairn/mapper.hpp"
#include "cairn/session.hpp"
#include "frames.hpp"
#include "guard.hpp"

namespace cairn::python {

/// A session, and all that uses it.
struct GuardedSession {
  Session session;
  std::shared_ptr<Guard> guard = std::make_shared<Guard>();
};

/// A mapper that threads may share: their calls wait for each other.
struct GuardedMapper {
  std::shared_ptr<GuardedSession> session;  ///< null: all is in memory. It outlives the mapper
  Mapper mapper;
  std::shared_ptr<Guard> guard;
  SizedFrame scratch{};  ///< of own images, whose memory is used again
  int next = 0;          ///< index of the next one
};

/// What Python says of a mapper's settings.
[[nodiscard]] Options options_of(const Rig& rig, const std::optional<Options>& given, std::optional<float> voxel_size);

}  // namespace cairn::python
