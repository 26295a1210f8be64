// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include "cairn/frame.hpp"

namespace cairn {

struct OpenNiOptions {
  std::filesystem::path camera;   // see SourceOptions
  std::filesystem::path copy_to;  // see SourceOptions
};

/// A sensor by its OpenNI2 URI, the first one for an empty URI, or an .oni file. Depth is registered to colour by the
/// device, or colour to depth here. Throws std::runtime_error with what is missing and what to install or allow.
[[nodiscard]] std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions& options = {});

}  // namespace cairn
