// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/source.hpp"

namespace cairn {

/// The frames of a recording of ROS, in its order. Throws std::runtime_error with what is missing, where, and what to
/// do.
[[nodiscard]] std::unique_ptr<Source> open_ros(const std::filesystem::path& recording, const SourceOptions& options);

}  // namespace cairn
