// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/source.hpp"

namespace cairn {

/// The frames of a .sens file of ScanNet, version 4. Only an index of the frames is held. Throws std::runtime_error
/// with what is wrong, at which byte or frame, and what to do.
[[nodiscard]] std::unique_ptr<Source> open_sens(const std::filesystem::path& file, const FrameRange& range = {},
                                                bool depth_only = false);
/// The poses in a .sens file, by frame timestamp; frames without one are left out.
[[nodiscard]] Trajectory sens_truth(const std::filesystem::path& file);

}  // namespace cairn
