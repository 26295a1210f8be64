// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replaces openni_source.cpp in builds without OpenNI2.
#include <stdexcept>

#include "io/openni.hpp"

namespace cairn {

std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions&) {
  throw std::runtime_error((uri.empty() ? "openni:" : uri) +
                           ": no depth sensor or .oni file can be opened, this build has no OpenNI2: build with "
                           "CAIRN_OPENNI=ON, which needs libopenni2-dev");
}

}  // namespace cairn
