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
  uvec2 tile;   // pixels a workgroup, multiples of 8 strides
  uint stride;  // pixels; every stride-th of a row and a column is looked at
  float max_distance;  // metres
  float min_cosine;    // of the angle between matched normals
  float huber;         // in standard deviations of the depth noise
  float cut;           // residuals from here on have no weight; 0: all have some
  uint crossed;        // 1: the matrix pairs live normals with the model's, so that noise of either cancels
};

// Sums over pixels of the normal equations A x = b of x = (rotation, translation), in units of the noise; A's upper
// triangle by blocks.
struct NormalEquations {
  vec3 rr0;  // rotation-rotation: xx xy xz
  vec3 rr1;  // yy yz zz
  vec3 rt0;  // rotation-translation, by rows
  vec3 rt1;
  vec3 rt2;
  vec3 tt0;  // translation-translation: xx xy xz
  vec3 tt1;  // yy yz zz
  vec3 br;
  vec3 bt;
};

struct IcpSums {
  NormalEquations normal;
  float squared;  // of the residuals of inliers
  float inliers;
  float seen;     // live points that fall on a point of the model
  float live;     // live points
  uint parts;     // sums that this workgroup wrote: one a subgroup, whose size is the device's choice
};

struct PhotometricReducePush {
  Pinhole camera;
  Rigid keyframe_from_live;  // from the depth camera at its moment to the keyframe's colour camera at that one's
  vec3 rotation;                 // p + rotation x p + translation: from the depth camera to the colour camera at their moments
  vec3 translation;
  uvec2 tile;
  uint stride;
  float gain;  // of live brightness, so that it equals the keyframe's
  float bias;
  float inverse_sigma;  // of the residuals, 1 / brightness in 0..1
};

// Like IcpSums, of x = (rotation, translation) in the keyframe's frame, residuals in brightness.
struct PhotometricSums {
  NormalEquations normal;
  float squared;  // weighted
  float seen;     // points with a brightness in both images
  float fitting;  // of these, within 2.5 sigma
  float weight;
  float live;     // weighted sums of live brightness, the keyframe's, and their products
  float key;
  float live_live;
  float live_key;
  uint parts;  // see IcpSums
};

struct MovingJudgePush {
  Pinhole camera;  // of the coarsest level
  Rigid model_from_live;
  Rigid keyframe_from_live;
};

// A pixel's verdict: what stands in front of the map by more than noise explains, and what the keyframe saw through.
const uint kStandsInFront = 1u;
const uint kSeenThrough = 2u;

struct MovingMaskPush {
  uint width;  // of the coarsest level
  uint height;
  uint factor;  // pixels of the fusion image a pixel of this level
  uint full_width;
  uint most;  // that may be moving
  uint only_count;
};

#ifdef __cplusplus
static_assert(sizeof(MovingJudgePush) <= 128 && sizeof(PhotometricReducePush) <= 128);
}  // namespace cairn::shader
#else
// A workgroup of 64 threads walks its tile of the image in steps of 8 x 8 of the pixels that are looked at.
struct Tile {
  ivec2 begin;  // this thread's first pixel
  int end_x;
  int width;
  int step;
  int steps;
};
Tile tile_of(Pinhole camera, uvec2 size, uint stride, int group, int thread) {
  int across = (int(camera.width) + int(size.x) - 1) / int(size.x), step = 8 * int(stride);
  ivec2 corner = ivec2((group % across) * int(size.x), (group / across) * int(size.y));
  return Tile(corner + int(stride) * ivec2(thread & 7, thread >> 3), corner.x + int(size.x), int(size.x), step,
              int(size.x * size.y) / (step * step));
}
ivec2 step_in(Tile tile, ivec2 at) {
  at.x += tile.step;
  return at.x < tile.end_x ? at : ivec2(at.x - tile.width, at.y + tile.step);
}
#endif
#endif
