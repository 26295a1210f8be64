// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Training of Gaussian splats, shared by `splat` and `reconstruct --splat`.
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cairn/mapping/splat_training.hpp"
#include "cli/interrupt.hpp"

namespace cairn::apps {

/// Message for the first signal during a training.
constexpr const char* kWritingSplats = "writing the splats so far; interrupt again to end at once";

/// Trains splats until a signal, shows the progress, and writes `file`.
[[nodiscard]] TrainedSplats train_and_write(Map& map, const SplatOptions& options, const OpenRecording& open,
                                            const std::filesystem::path& file, Interrupt& interrupt);

/// Fields of trained splats in report.json and in the --json output.
[[nodiscard]] nlohmann::json to_json(const TrainedSplats& trained, const std::filesystem::path& file);

/// Prints the written file and the errors.
void print(const TrainedSplats& trained, const std::filesystem::path& file, const char* images);

}  // namespace cairn::apps
