// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera motion during the readout of a rolling shutter (Forssen & Ringaby 2010, with measured depth instead of pure
// rotation).
#ifndef CAIRN_SHUTTER_H
#define CAIRN_SHUTTER_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct ShutterMotion {  // maps a point from the camera frame `delay` seconds after the frame's time to the camera frame
                        // at that time:
  vec3 turn;            // rad/s; the rotation vector is delay * (turn + delay * turn_change)
  vec3 turn_change;     // rad/s^2
  vec3 shift;           // m/s, used like `turn`
  vec3 shift_change;    // m/s^2
  float readout;        // seconds
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
ShutterMotion local(ShutterMotion m) { return ShutterMotion(m.turn, m.turn_change, m.shift, m.shift_change, m.readout); }

// Second-order expansion; the rotation during a readout is small.
vec3 turned(vec3 turn, vec3 p) {
  vec3 first = cross(turn, p);
  return p + first + 0.5 * cross(turn, first);
}
// `row`: as a fraction of the image height. at_once maps a point seen by that row at p to the camera frame at the
// frame's time; at_row is the inverse.
vec3 at_once(ShutterMotion m, vec3 p, float row) {
  float delay = m.readout * (clamp(row, 0.0, 1.0) - 0.5);
  return turned(delay * (m.turn + delay * m.turn_change), p) + delay * (m.shift + delay * m.shift_change);
}
vec3 at_row(ShutterMotion m, vec3 p, float row) {
  float delay = m.readout * (clamp(row, 0.0, 1.0) - 0.5);
  return turned(-delay * (m.turn + delay * m.turn_change), p - delay * (m.shift + delay * m.shift_change));
}
#endif
#endif
