// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <utility>

#include "cairn/mapping/mapper.hpp"

namespace cairn {

/// State of a Mapper, for the library itself.
class MapperAccess {
 public:
  [[nodiscard]] static Mapper mapper_of(std::shared_ptr<MapState> state) { return Mapper(std::move(state)); }
  [[nodiscard]] static const std::shared_ptr<MapState>& state(const Mapper& mapper) { return mapper.state_; }
};

}  // namespace cairn
