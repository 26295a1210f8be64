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
  uvec2 tile;          // pixels per workgroup, multiples of 8 strides
  float max_distance;  // meters
  float min_cosine;    // of the angle between matched normals
  float huber;         // in standard deviations of the depth noise
  float cut;           // residuals from this value on have no weight; 0: no cut
  uint crossed;        // 1: the matrix pairs live normals with the model's, so that their independent noise cancels
};

// Sums over pixels of the normal equations A x = b for x = (rotation, translation), in units of the noise; upper
// triangle of A by blocks.
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
  float squared;  // sum of weighted squared residuals of inliers
  float inliers;
  float seen;     // live points that project onto a point of the model
  float live;     // live points
  uint parts;     // number of sums that this workgroup wrote: one per subgroup; the device chooses the subgroup size
};

struct PhotometricReducePush {
  Pinhole camera;
  Rigid keyframe_from_model;  // the keyframe's color camera at its own time, from the model frame
  vec3 rotation;              // p + rotation x p + translation: from the depth camera to the color camera at their own
                              // times
  vec3 translation;
  uvec2 tile;
  uint first;  // index of the first sum
};

// Like IcpSums, for x = (rotation, translation) in the keyframe's frame; residuals in brightness.
struct PhotometricSums {
  NormalEquations normal;
  float squared;  // weighted
  float seen;     // points with a brightness in both images
  float fitting;  // subset of seen within 2.5 sigma
  float weight;
  float live;     // weighted sums of the live brightness, the keyframe's brightness, and their products
  float key;
  float live_live;
  float live_key;
  uint parts;  // see IcpSums
};

const uint kMaxLevels = 5;
const uint kSparse = 2u;  // stride in the finest level until the pose is close
const uint kUndecided = 0u, kWithoutWeak = 1u, kWithAll = 2u;  // AlignState::directions
const uint kAtWork = 0u, kDone = 1u, kAgain = 2u;                    // AlignState::outcome

// State of a running alignment: initialized by the host, advanced by pose_step after each iteration, and read by the
// reductions. It also holds the indirect dispatch sizes: levels that are finished dispatch no groups.
struct AlignState {
  Rigid model_from_live;
  Rigid model_from_corrected;  // pose assumed by the rolling shutter correction
  float readout;            // readout time of the rows, as a share of the time since the previous frame
  float gain, bias, sigma;  // keyframe brightness = gain * live + bias; sigma of the residuals, brightness in 0..1
  uint stride;              // pixels; every stride-th pixel of a row and a column is used
  uint level;
  uint iteration;  // within the level
  uint iterations[kMaxLevels];
  uint is_near;     // the pose is close: all pixels are used
  uint directions;  // selection of directions that the geometry may move
  uint outcome;
  // Dispatch sizes: the sums of each level, its steps, the geometry with crossed pairs of normals, and the costs of
  // clocks.
  Groups sums[kMaxLevels];
  Groups steps[kMaxLevels];
  Groups crossed;
  Groups clocks;
  // Projection that removes weak directions from the geometry's equations: the sum of the dyads of the other
  // directions, upper triangle by blocks, scaled such that a radian equals `lever` meters.
  vec3 keep_rr0, keep_rr1, keep_rt0, keep_rt1, keep_rt2, keep_tt0, keep_tt1;
  float lever;
  uint weak;  // number of weak directions
  // Results of the last iteration:
  NormalEquations normal;                    // of both terms in units of their variances, in the model frame
  float squared, inliers, seen, live;        // of the geometry, see IcpSums
  float photometric_seen, photometric_fitting;
  uint uses_brightness;
  uint degenerate_directions, unobserved;
};

struct PoseStepPush {
  Rigid keyframe_from_model;
  uint level;   // level of this iteration
  uint finest;  // finest level
  uint has_coarser;  // 1: levels coarser than the finest exist
  uint has_brightness;
  uint max_iterations;  // maximum number of iterations of the level
  uint groups;          // workgroups of the level's sums
  uint next_groups;     // workgroups of the next finer level's sums
  uint clock_groups;    // workgroups of the sums for the costs of clocks
  float pixels;         // of the level
  float converged;      // radians and meters; smaller steps end the iteration
  float converged_sparse;  // same with a stride
};

struct MovingJudgePush {
  Pinhole camera;  // of the coarsest level
  Rigid model_from_live;
  Rigid keyframe_from_live;
};

// Flags of a pixel: in front of the map by more than the noise; in the keyframe's free space.
const uint kInFrontOfMap = 1u;
const uint kSeenThrough = 2u;

struct MovingMaskPush {
  uint width;  // of the coarsest level
  uint height;
  uint factor;  // pixels of the fusion image per pixel of this level, along a side
  uint full_width;
  uint max_count;  // maximum number of moving pixels
  uint only_count;
};

#ifdef __cplusplus
static_assert(sizeof(MovingJudgePush) <= 128 && sizeof(PhotometricReducePush) <= 128 && sizeof(PoseStepPush) <= 128);
}  // namespace cairn::shader
#else
// A workgroup iterates over its tile of the image in blocks of eight pixels per row and as many rows as its threads
// fill, counting only the pixels in the stride.
struct Tile {
  ivec2 begin;  // first pixel of this thread
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
// The rolling shutter was corrected with a predicted pose. A different pose implies a different motion since the
// previous frame, of which each row has a share equal to the share of its time: additional displacement of a row's
// points.
float row_share(float row, Pinhole camera) { return (row + 0.5) / float(camera.height) - 0.5; }
ivec2 step_in(Tile tile, ivec2 at) {
  at.x += tile.step.x;
  return at.x < tile.end_x ? at : ivec2(at.x - tile.width, at.y + tile.step.y);
}
#endif
#endif
