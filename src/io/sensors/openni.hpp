// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cairn/io/sensors.hpp"
#include "cairn/mapping/frame.hpp"

namespace cairn {

struct OpenNiOptions {
  std::filesystem::path camera;   // see SourceOptions
  std::filesystem::path copy_to;  // see SourceOptions
};

/// Opens a sensor by its OpenNI2 URI (empty: the first sensor), or an .oni file. Depth is registered to color by the
/// device, or color to depth here. Throws std::runtime_error with the missing part and the package or permission
/// needed.
[[nodiscard]] std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions& options = {});
/// Connected sensors. Throws std::runtime_error in a build without OpenNI2, and without its drivers.
[[nodiscard]] std::vector<SensorInfo> list_openni();

}  // namespace cairn
