// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A TSDF voxel is two words:
//   x   distance (signed 16 bits, kDistanceUnits per truncation) | weight (16 bits, kWeightUnits per observation) << 16
//   y   red | green << 8 | blue << 16 | color weight << 24
// The host stores both in 64 bits, x in the lower half. Weight 0: unobserved.
#ifndef CAIRN_VOXEL_H
#define CAIRN_VOXEL_H
#include "shaders/types.h"
#ifdef __cplusplus
#include <cmath>
namespace cairn::shader {
#endif

const float kDistanceUnits = 32767.0f;
const float kWeightUnits = 256.0f;

// Packs the word x, in integer units.
constexpr uint distance_and_weight(int distance, int weight) { return (uint(distance) & 0xffffu) | (uint(weight) << 16); }

#ifdef __cplusplus
/// Packs a distance in truncations and a weight in observations; `color` is the word y.
inline std::uint64_t pack_voxel(float distance, float weight, uint color = 0) {
  return distance_and_weight(static_cast<int>(std::lround(distance * kDistanceUnits)),
                             static_cast<int>(std::lround(weight * kWeightUnits))) |
         std::uint64_t{color} << 32;
}
inline float voxel_distance(std::uint64_t voxel) {  // truncations
  return static_cast<float>(static_cast<std::int16_t>(voxel & 0xffff)) / kDistanceUnits;
}
inline float voxel_weight(std::uint64_t voxel) {  // observations
  return static_cast<float>((voxel >> 16) & 0xffff) / kWeightUnits;
}
}  // namespace cairn::shader
#else
// Conversions go through int: CPU devices have no vector instruction for unsigned conversions.
float voxel_distance(uint word) { return float(bitfieldExtract(int(word), 0, 16)) * (1.0 / kDistanceUnits); }  // truncations
float voxel_weight(uint word) { return float(int(word >> 16)) * (1.0 / kWeightUnits); }  // observations
// Minimum weight, in units, of voxels with at least this number of observations.
uint min_weight_units(float observations) { return max(1u, uint(observations * kWeightUnits)); }
#endif

#endif
