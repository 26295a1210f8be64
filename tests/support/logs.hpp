// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>

namespace cairn {

/// What MCAP's own readers and protobufjs find in a log, see read_mcap.mjs. Fails the test where they find a fault, or
/// are not installed.
[[nodiscard]] nlohmann::json read_log(const std::filesystem::path& file);

}  // namespace cairn
