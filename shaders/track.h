// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#ifndef CAIRN_TRACK_H
#define CAIRN_TRACK_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct IcpReducePush {
  Pinhole camera;
  Rigid model_from_live;
  uint threads;
  float max_distance;  // metres
  float min_cosine;    // of the angle between matched normals
  float huber;         // in standard deviations of the depth noise
};

// Sums over pixels of the normal equations A x = b of x = (rotation, translation), in units of the noise; A's upper
// triangle by blocks.
struct IcpSums {
  vec3 rr0;  // rotation-rotation: xx xy xz
  vec3 rr1;  // yy yz zz
  vec3 rt0;  // rotation-translation, by rows
  vec3 rt1;
  vec3 rt2;
  vec3 tt0;  // translation-translation: xx xy xz
  vec3 tt1;  // yy yz zz
  vec3 br;
  vec3 bt;
  float squared;  // of the residuals of inliers
  float inliers;
  float seen;     // live points that fall on a point of the model
  float live;     // live points
};

#ifdef __cplusplus
}  // namespace cairn::shader
#endif
#endif
