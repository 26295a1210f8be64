// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "mapper/map_state.hpp"

namespace cairn {

/// Opens a session for reading; its files cannot be removed in the meantime. Throws like read_session.
[[nodiscard]] std::shared_ptr<MapState> open_session(const std::filesystem::path& folder, int device);

}  // namespace cairn
