// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color maps and legends.
import { element } from './dom.js';

const kViridis = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
// Red behind the surface, then by distance from the surface.
const kDistance = [[214, 69, 65], [250, 250, 250], [246, 200, 90], [96, 170, 110], [60, 110, 170], [50, 60, 120]];

function along(stops, share) {
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
  return stops[i].map((c, k) => c + (at - i) * (stops[i + 1][k] - c));
}

/** sRGB bytes for a share from 0 to 1. */
export const viridis = (share) => along(kViridis, share);
export const away = (share) => along(kDistance.slice(1), share);
export const kBehindColor = kDistance[0];

export function legend(ramp, low, high) {
  const canvas = element('canvas', { width: 256, height: 1, className: 'ramp', aria: { hidden: 'true' } }), context = canvas.getContext('2d');
  const picture = context.createImageData(256, 1);
  for (let i = 0; i < 256; ++i) picture.data.set([...ramp(i / 255), 255], 4 * i);
  context.putImageData(picture, 0, 0);
  return element('div', { className: 'legend' }, canvas, element('span', {}, low), element('span', {}, high));
}
