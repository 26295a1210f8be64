// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once

namespace cairn {

/// Rolling-shutter readout time of the first Kinect's images, seconds: Ringaby & Forssen 2011.
constexpr double kKinectDepthReadout = 0.03055, kKinectColorReadout = 0.02611;

}  // namespace cairn
