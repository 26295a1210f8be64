// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/pose_checksum.hpp"

#include <fmt/format.h>

namespace cairn {

std::string PoseChecksum::text() const { return fmt::format("{:016x}", sum_.checksum()); }

}  // namespace cairn
