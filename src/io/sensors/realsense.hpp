// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "cairn/io/sensors.hpp"
#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Opens a RealSense camera by its serial number; empty: the first. Throws std::runtime_error with the cause and the
/// remedy.
[[nodiscard]] std::unique_ptr<Source> open_realsense(const std::string& serial);
/// Connected cameras. Throws std::runtime_error without a usable librealsense2.
[[nodiscard]] std::vector<SensorInfo> list_realsense();

}  // namespace cairn
