// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "frames.hpp"
#include "guard.hpp"

namespace cairn::python {

/// Session, shared by its users.
struct GuardedSession {
  Session session;
  std::shared_ptr<Guard> guard = std::make_shared<Guard>();
};

/// Mapper for use by several threads; calls are serialized.
struct GuardedMapper {
  std::shared_ptr<GuardedSession> session;  ///< null: all is in memory. Outlives the mapper
  Mapper mapper;
  std::shared_ptr<Guard> guard;
  Options options;       ///< as given; for a resumed session defaults for its sensor
  SizedFrame scratch{};  ///< for arrays; its memory is reused
  int next = 0;          ///< index of the next frame
};

/// Options from the arguments of a Python mapper.
[[nodiscard]] Options options_of(const Rig& rig, const std::optional<Options>& given, std::optional<float> voxel_size);

}  // namespace cairn::python
