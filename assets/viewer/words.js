// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Number formatting for users.

/** Rounds away float noise. */
const short = (value, digits) => String(Number(value.toPrecision(digits)));

export function meters(value) {
  const size = Math.abs(value);
  if (size >= 0.9995) return `${value.toFixed(3)} m`;
  if (size >= 0.0995) return `${(100 * value).toFixed(1)} cm`;
  return `${(1000 * value).toFixed(1)} mm`;
}

export const millimeters = (value) => `${(1000 * value).toFixed(2)} mm`;

/** Length of a slider or a legend. */
export const height = (value) => `${value.toFixed(2).replace(/^-(?=[0.]*$)/, '')} m`;

export const squareMeters = (value) => (value >= 0.1 ? `${value.toFixed(3)} m²` : `${(1e4 * value).toFixed(1)} cm²`);

/** Length of a setting, not of a measurement: 1 cm, 2.5 mm, 5 m. */
export function length(value) {
  if (value >= 1) return `${short(value, 4)} m`;
  return value >= 0.0099999 ? `${short(100 * value, 4)} cm` : `${short(1000 * value, 4)} mm`;
}

export function bytes(count) {
  if (count < 1e3) return `${count} B`;
  if (count < 1e6) return `${short(count / 1e3, 2)} kB`;
  return count < 1e9 ? `${short(count / 1e6, count < 1e7 ? 2 : 3)} MB` : `${short(count / 1e9, 3)} GB`;
}

export function seconds(value) {
  const m = Math.floor(value / 60), s = value - 60 * m;
  return m > 0 ? `${m}:${s.toFixed(1).padStart(4, '0')}` : `${s.toFixed(1)} s`;
}

export const count = (value) => value.toLocaleString('en');

const kOptions = { voxel_size: ['Voxel', length], truncation: ['Truncation', length], max_depth: ['Depth used', (v) => `up to ${length(v)}`],
                   track_finest_level: ['Tracking at', (v) => (v === 0 ? 'full resolution' : `1/${2 ** v} of the resolution`)] };

/** A parameter of the run: [name, value]. */
export function option([name, value]) {
  const known = kOptions[name];
  if (known && typeof value === 'number') return [known[0], known[1](value)];
  const words = name.replaceAll('_', ' ');
  return [words[0].toUpperCase() + words.slice(1), typeof value === 'number' ? short(value, 6) : String(value)];
}
