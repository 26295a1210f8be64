// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads a LAS file with the reader of copc; prints `count x y z width depth height`, bounds in meters, then `r g b` of
// the mean color, 0 to 255.
import { readFile } from 'node:fs/promises';
import { Las } from 'copc';

const bytes = new Uint8Array(await readFile(process.argv[2]));
const header = Las.Header.parse(bytes);
if (header.pointDataRecordFormat !== 7 || header.minorVersion !== 4) throw new Error('no LAS 1.4 with colors');
const view = Las.View.create(bytes.subarray(header.pointDataOffset), header);
if (view.pointCount !== header.pointCount) throw new Error(`${view.pointCount} of ${header.pointCount} points`);
const values = (name) => {
  const get = view.getter(name);
  return Array.from({ length: view.pointCount }, (_, i) => get(i));
};
const [x, y, z] = ['X', 'Y', 'Z'].map(values);
const low = [x, y, z].map((all) => all.reduce((a, b) => Math.min(a, b)));
const high = [x, y, z].map((all) => all.reduce((a, b) => Math.max(a, b)));
low.forEach((v, i) => {
  if (Math.abs(v - header.min[i]) > 1e-6 || Math.abs(high[i] - header.max[i]) > 1e-6) throw new Error('wrong bounds');
});
console.log([view.pointCount, ...low.map((v) => v.toFixed(4)), ...high.map((v, i) => (v - low[i]).toFixed(4))].join(' '));
const mean = ['Red', 'Green', 'Blue'].map((name) => values(name).reduce((a, b) => a + b) / view.pointCount / 257);
console.log(mean.map((v) => v.toFixed(1)).join(' '));
