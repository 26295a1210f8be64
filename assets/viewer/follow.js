// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Viewpoint for following the sensor.

const kMinDistance = 1.12;                                  // minimum distance as a multiple of the depth: behind the sensor
const kMinDistancePortrait = 0.55;                          // the same on a portrait screen: in front of the sensor
const kHeight = 0.12;                                       // height above the sensor, relative to the distance
const kDefaultDepth = 1.5, kMinDepth = 0.4, kMaxDepth = 4;  // meters to the surface in view

/**
 * Viewpoint at which the sensor's view fills the picture: a compromise between fitting the complete view and leaving no
 * border. `view`: fx in image widths, aspect and median depth of the sensor; `fov`: vertical field of view in radians.
 * Returns eye and target in the sensor's frame.
 */
export function behind(view, fov, aspect) {
  const depth = Math.min(Math.max(view.depth ?? kDefaultDepth, kMinDepth), kMaxDepth), t = 2 * Math.tan(fov / 2);
  const across = depth / view.fx / (t * aspect), down = depth / view.fx / view.aspect / t;
  const distance = Math.max(Math.sqrt(across * down), (aspect < 1 ? kMinDistancePortrait : kMinDistance) * depth);
  return { eye: [0, -kHeight * distance, depth - distance], target: [0, 0, depth] };
}
