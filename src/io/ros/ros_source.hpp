// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/io/source.hpp"

namespace cairn {

/// Opens a ROS recording; frames are in recording order. Throws std::runtime_error with the missing data, its place and
/// a remedy.
[[nodiscard]] std::unique_ptr<Source> open_ros(const std::filesystem::path& recording, const SourceOptions& options);

}  // namespace cairn
