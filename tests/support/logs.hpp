// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>

namespace cairn {

/// Contents of a log as read by MCAP's own readers and protobufjs, see read_mcap.mjs. Fails the test on errors, or if
/// the readers are not installed.
[[nodiscard]] nlohmann::json read_log(const std::filesystem::path& file);

}  // namespace cairn
