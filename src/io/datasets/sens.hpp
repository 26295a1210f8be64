// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/io/source.hpp"

namespace cairn {

/// Opens a .sens file of ScanNet, version 4. Only a frame index is kept in memory. Throws std::runtime_error with the
/// error, its byte or frame, and a remedy.
[[nodiscard]] std::unique_ptr<Source> open_sens(const std::filesystem::path& file, const FrameRange& range = {},
                                                bool depth_only = false);
/// Reads the poses of a .sens file, by frame timestamp; frames without a pose are skipped.
[[nodiscard]] Trajectory sens_truth(const std::filesystem::path& file);

}  // namespace cairn
