// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Distortion coefficients of Lens::brown_conrady for librealsense's inverse model k1 k2 p1 p2 k3, which maps a
/// measured point to the ray: a least-squares fit over the camera's image.
[[nodiscard]] std::array<double, 8> invert_distortion(const Camera& camera, const std::array<double, 5>& inverse);

}  // namespace cairn
