// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Where to look from while the picture follows the sensor.

const kBehind = 1.12;                  // times the way to what is seen: at least so far away, behind the sensor
const kNear = 0.55;                    // the same on a screen that is high and narrow: before it
const kAbove = 0.12;                   // of that way: so that it looks over the sensor
const kUsualDepth = 1.5, kLeast = 0.4, kMost = 4;  // metres to what is seen

/**
 * So that what the sensor sees fills the picture: between the distance at which all of it is in the picture and the one
 * at which it leaves no edge free. `view`: fx in image widths, aspect and median depth of the sensor; `fov` of the
 * picture in radians from top to bottom. Gives eye and target in the sensor's frame.
 */
export function behind(view, fov, aspect) {
  const depth = Math.min(Math.max(view.depth ?? kUsualDepth, kLeast), kMost), t = 2 * Math.tan(fov / 2);
  const across = depth / view.fx / (t * aspect), down = depth / view.fx / view.aspect / t;
  const distance = Math.max(Math.sqrt(across * down), (aspect < 1 ? kNear : kBehind) * depth);
  return { eye: [0, -kAbove * distance, depth - distance], target: [0, 0, depth] };
}
