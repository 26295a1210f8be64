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
  uvec2 tile;          // pixels a workgroup, multiples of 8 strides
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
  Rigid keyframe_from_model;  // the keyframe's colour camera at its moment, from the frame that the pose is sought in
  vec3 rotation;              // p + rotation x p + translation: from the depth camera to the colour camera at their moments
  vec3 translation;
  uvec2 tile;
  uint first;  // of the sums
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

const uint kMaxLevels = 5;
const uint kSparse = 2u;  // of the finest level's pixels, in a row and a column, until the pose is close
const uint kUndecided = 0u, kWithoutWeak = 1u, kWithAll = 2u;  // AlignState::directions
const uint kAtWork = 0u, kDone = 1u, kAgain = 2u;                    // AlignState::outcome

// An alignment on its way: the host begins it, pose_step takes it from iteration to iteration, and the sums read where it
// is. Kernels of an iteration are dispatched by what it says: of a level that is over nothing runs any more.
struct AlignState {
  Rigid model_from_live;
  Rigid model_from_undone;  // that a rolling shutter was undone for
  float readout;            // of its rows, as a share of the time since the frame before
  float gain, bias, sigma;  // keyframe brightness = gain * live + bias; of the residuals, brightness in 0..1
  uint stride;              // pixels; every stride-th of a row and a column is looked at
  uint level;
  uint iteration;  // of the level
  uint iterations[kMaxLevels];
  uint is_near;     // the pose is close: all pixels are looked at
  uint directions;  // of the pose that the geometry may move
  uint outcome;
  // What runs: the sums of each level, its steps, the geometry once more with pairs of normals, and the costs of clocks.
  Groups sums[kMaxLevels];
  Groups steps[kMaxLevels];
  Groups crossed;
  Groups clocks;
  // A projection that takes weak directions out of the geometry's equations: the sum of the others' dyads, its upper
  // triangle by blocks, in units where a radian moves the scene by `lever` metres.
  vec3 keep_rr0, keep_rr1, keep_rt0, keep_rt1, keep_rt2, keep_tt0, keep_tt1;
  float lever;
  uint weak;  // directions
  // Of the last iteration:
  NormalEquations normal;                    // of both terms in units of their variances, in the model's frame
  float squared, inliers, seen, live;        // of the geometry, see IcpSums
  float photometric_seen, photometric_fitting;
  uint uses_brightness;
  uint degenerate_directions, unobserved;
};

struct PoseStepPush {
  Rigid keyframe_from_model;
  uint level;   // whose iteration it was
  uint finest;  // of the levels
  uint has_coarser;  // levels than the finest
  uint has_brightness;
  uint most;          // iterations of the level
  uint groups;        // of the level's sums
  uint next_groups;   // of the next finer level's
  uint clock_groups;  // of the sums that tell the costs of clocks
  float pixels;       // of the level
  float converged;    // radians and metres, a step that is the last
  float converged_sparse;  // where not all pixels were looked at
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
static_assert(sizeof(MovingJudgePush) <= 128 && sizeof(PhotometricReducePush) <= 128 && sizeof(PoseStepPush) <= 128);
}  // namespace cairn::shader
#else
// A workgroup walks its tile of the image in blocks of eight pixels a row, and of as many rows as its threads fill, of the
// pixels that are looked at.
struct Tile {
  ivec2 begin;  // this thread's first pixel
  ivec2 step;
  int end_x;
  int width;
  int steps;
};
Tile tile_of(Pinhole camera, uvec2 size, uint stride, int group, int thread, int threads) {
  int across = (int(camera.width) + int(size.x) - 1) / int(size.x);
  ivec2 corner = ivec2((group % across) * int(size.x), (group / across) * int(size.y));
  ivec2 step = int(stride) * ivec2(8, threads >> 3);
  return Tile(corner + int(stride) * ivec2(thread & 7, thread >> 3), step, corner.x + int(size.x), int(size.x),
              int(size.x * size.y) / (step.x * step.y));
}
// A rolling shutter was undone by a pose that was guessed. With another the camera has moved otherwise since the frame
// before, and each row by as much of that as its time is a share of that time: how much farther its points go.
float row_share(float row, Pinhole camera) { return (row + 0.5) / float(camera.height) - 0.5; }
ivec2 step_in(Tile tile, ivec2 at) {
  at.x += tile.step.x;
  return at.x < tile.end_x ? at : ivec2(at.x - tile.width, at.y + tile.step.y);
}
#endif
#endif
