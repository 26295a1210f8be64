// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera path: positions over time, and stretches without poses.
import * as THREE from 'three';

const kMinGap = 8;  // times the median pose interval; a longer interval is a stretch without poses

const kTolerance = 0.4;  // of the median interval

/** Index of the last of `count` sorted times not after `time`, or 0. */
function last(count, timeOf, time) {
  let low = 0, high = count - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (timeOf(middle) > time) high = middle - 1;
    else low = middle;
  }
  return low;
}

/** Position of the first vertex at or after `time` on a polyline of [t, x, y, z]. */
export function placeAt(points, time) {
  let low = 0, high = points.length / 4 - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[4 * middle] < time) low = middle + 1;
    else high = middle;
  }
  return [points[4 * low + 1], points[4 * low + 2], points[4 * low + 3]];
}

/** Interpolated pose at a time: `trajectory` has t, x, y, z, qx, qy, qz, qw. */
export function poseAt(trajectory, time) {
  const i = last(trajectory.length, (n) => trajectory[n][0], time);
  const a = trajectory[i], b = trajectory[Math.min(i + 1, trajectory.length - 1)];
  const share = b[0] > a[0] ? THREE.MathUtils.clamp((time - a[0]) / (b[0] - a[0]), 0, 1) : 0;
  const place = new THREE.Vector3(...a.slice(1, 4)).lerp(new THREE.Vector3(...b.slice(1, 4)), share);
  const turn = new THREE.Quaternion(...a.slice(4)).slerp(new THREE.Quaternion(...b.slice(4)), share);
  return { place, turn, matrix: new THREE.Matrix4().compose(place, turn, new THREE.Vector3(1, 1, 1)) };
}

/** Index of the nearest of sorted times. */
export function nearest(times, time) {
  const i = last(times.length, (n) => times[n], time);
  return i + 1 < times.length && times[i + 1] - time < time - times[i] ? i + 1 : i;
}

/** Stretches without poses: [time before, time after], due to lost frames or gaps between poses. */
export function lostStretches(trajectory, frames) {
  const times = trajectory.map(([t]) => t), found = [];
  if (times.length < 2) return found;
  const steps = times.slice(1).map((t, i) => t - times[i]).sort((a, b) => a - b), median = steps[steps.length >> 1];
  const lost = frames.filter(({ state }) => state === 'lost').map(({ timestamp }) => timestamp);
  const tolerance = kTolerance * median;  // clock difference of color and depth
  for (let i = 0, k = 0; i + 1 < times.length; ++i) {
    while (k < lost.length && lost[k] <= times[i] + tolerance) ++k;
    const isLost = k < lost.length && lost[k] < times[i + 1] - tolerance;
    if (isLost || times[i + 1] - times[i] > Math.max(0.5, kMinGap * median)) found.push([times[i], times[i + 1]]);
  }
  return found;
}
