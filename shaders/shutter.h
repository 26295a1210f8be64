// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How a camera moves while a rolling shutter reads its image (Forssen & Ringaby 2010, with depth that is measured instead
// of a rotation alone).
#ifndef CAIRN_SHUTTER_H
#define CAIRN_SHUTTER_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct ShutterMotion {  // of a point, from the camera as it is `delay` seconds after a frame's time to it at that time:
  vec3 turn;            // rad/s; the rotation vector is delay * (turn + delay * turn_change)
  vec3 turn_change;     // rad/s^2
  vec3 shift;           // m/s, likewise
  vec3 shift_change;    // m/s^2
  float readout;        // seconds
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
ShutterMotion local(ShutterMotion m) { return ShutterMotion(m.turn, m.turn_change, m.shift, m.shift_change, m.readout); }

// Turns of a readout are small: two orders of them do.
vec3 turned(vec3 turn, vec3 p) {
  vec3 first = cross(turn, p);
  return p + first + 0.5 * cross(turn, first);
}
// `row`: as a share of the image's height. As the camera at the frame's time has what that row saw at p, and the other way.
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
