// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/frame.hpp"

namespace cairn {

/// A Matroska file of the Azure Kinect's recorder (k4arecorder). Throws std::runtime_error with what is missing and
/// what to do.
[[nodiscard]] std::unique_ptr<Source> open_azure_kinect(const std::filesystem::path& file);

}  // namespace cairn
