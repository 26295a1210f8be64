// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "cairn/io/sensors.hpp"
#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Opens an Azure Kinect or Femto by its serial number; empty: the first. Throws std::runtime_error with the cause and
/// the remedy.
[[nodiscard]] std::unique_ptr<Source> open_k4a(const std::string& serial);
/// Connected cameras. Throws std::runtime_error without a usable libk4a.
[[nodiscard]] std::vector<SensorInfo> list_k4a();

}  // namespace cairn
