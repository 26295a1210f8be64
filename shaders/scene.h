// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Synthetic scenes: unions of solids with solid textures. All lengths in meters, world frame (y down).
#ifndef CAIRN_SCENE_H
#define CAIRN_SCENE_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kBox = 0;       // rotated about the vertical
const uint kSphere = 1;    // radius half_size.x
const uint kCylinder = 2;  // upright: radius half_size.x, half height half_size.y
const uint kHollow = 3;    // everything outside a box: the walls of a room

const uint kPlain = 0;
const uint kChecker = 1;
const uint kWood = 2;
const uint kTiles = 3;
const uint kPatches = 4;   // cells of random colors, like books or a picture

struct Solid {
  vec3 center;
  vec3 half_size;
  vec2 heading;  // cosine and sine of the rotation about the vertical
  float reach;   // radius of a bounding ball around the center; infinite for kHollow
  uint shape;
  uint pattern;
  float scale;   // of the pattern
  vec3 color;   // linear in 0..1, as stored in images
  vec3 second;   // second color of the pattern
};

const int kSolidWords = 18;  // size of Solid

struct SceneRenderPush {
  Pinhole camera;
  Rigid world_from_camera;
  uint solids;
  uint is_bent;  // lens distortion: rays are given per pixel
  uint is_rolling;  // each row has its own pose
};

#ifdef __cplusplus
static_assert(sizeof(Solid) == 4 * kSolidWords);
}  // namespace cairn::shader
#endif
#endif
