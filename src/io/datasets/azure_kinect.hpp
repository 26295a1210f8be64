// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Opens a Matroska file of the Azure Kinect recorder (k4arecorder). Throws std::runtime_error with the missing data
/// and a remedy.
[[nodiscard]] std::unique_ptr<Source> open_azure_kinect(const std::filesystem::path& file);

}  // namespace cairn
