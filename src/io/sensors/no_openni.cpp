// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replaces openni_source.cpp in builds without OpenNI2.
#include <stdexcept>

#include "io/sensors/openni.hpp"

namespace cairn {
namespace {

constexpr const char* kReason =
    "depth sensors and .oni files need OpenNI2, which this build lacks: build with CAIRN_OPENNI=ON, which "
    "needs "
    "libopenni2-dev";

}  // namespace

std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions&) {
  throw std::runtime_error((uri.empty() ? "openni:" : uri) + ": " + kReason);
}

std::vector<SensorInfo> list_openni() { throw std::runtime_error(kReason); }

}  // namespace cairn
