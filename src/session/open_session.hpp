// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>

#include "map/map_state.hpp"

namespace cairn {

/// A session as it was made, to look at it: nobody may remove its files meanwhile. Throws like read_session.
[[nodiscard]] std::shared_ptr<MapState> open_session(const std::filesystem::path& folder, int device);

}  // namespace cairn
