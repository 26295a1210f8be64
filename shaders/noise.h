// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// cairn::SensorModel in shaders, as specialization constants.
#ifndef CAIRN_NOISE_H
#define CAIRN_NOISE_H
#include "shaders/types.h"
#ifdef __cplusplus
#include <array>

#include "cairn/mapping/sensor_model.hpp"

namespace cairn::shader {

/// Specialization constants of kernels with this header.
inline std::array<float, 4> constants_of(const SensorModel& m) {
  return {m.floor, m.growth, m.sharpest, m.weight == SensorModel::Weight::by_noise ? 1.0f : 0.0f};
}

}  // namespace cairn::shader
#else
layout(constant_id = 0) const float kNoiseFloor = 0.0012;
layout(constant_id = 1) const float kNoiseGrowth = 0.0019;
layout(constant_id = 2) const float kNoiseSharpest = 0.4;
layout(constant_id = 3) const float kWeightByNoise = 0.0;

// Standard deviation of a depth measurement, meters.
float depth_noise(float z) { return kNoiseFloor + kNoiseGrowth * (z - kNoiseSharpest) * (z - kNoiseSharpest); }
vec4 depth_noise(vec4 z) { return vec4(depth_noise(z.x), depth_noise(z.y), depth_noise(z.z), depth_noise(z.w)); }

// Weight of a measurement in fusion.
float depth_weight(float z) {
  return kWeightByNoise > 0.0 ? min(1.0, depth_noise(1.0) / depth_noise(z)) : 1.0 / max(1.0, z * z);
}
#endif
#endif
