// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Fields of the map: distance to the surface, observations, and standard deviation of the surface. Map axes.

const kHeader = 40;  // bytes

/** Parses the format of src/view/fields.hpp; throws for any other input. */
export function readFields(buffer) {
  const words = new DataView(buffer), u32 = (i) => words.getUint32(4 * i, true), f32 = (i) => words.getFloat32(4 * i, true);
  if (buffer.byteLength < kHeader || u32(0) !== 0x444c4643 || u32(1) !== 1) throw new Error('these are not fields of version 1');
  const [nx, ny, nz] = [u32(2), u32(3), u32(4)], cells = nx * ny * nz;
  if (buffer.byteLength !== kHeader + 3 * cells) throw new Error(`the fields are cut off: ${buffer.byteLength} bytes for ${cells} cells`);
  const array = (i) => new Uint8Array(buffer, kHeader + i * cells, cells);
  const origin = [f32(5), f32(6), f32(7)], spacing = f32(8), maxDistance = f32(9);
  const fields = { size: [nx, ny, nz], origin, spacing, maxDistance, distance: array(0), weight: array(1), sigma: array(2) };
  fields.meters = (byte) => (byte === 0 ? null : (byte - 128) / 127 * maxDistance);
  /** Value of the cell at a position of the map; if it is empty, the maximum of the adjacent cells. */
  fields.at = (values, x, y, z) => {
    const i = Math.round((x - origin[0]) / spacing), j = Math.round((y - origin[1]) / spacing), k = Math.round((z - origin[2]) / spacing);
    const value = (a, b, c) => (a < 0 || b < 0 || c < 0 || a >= nx || b >= ny || c >= nz ? 0 : values[a + nx * (b + ny * c)]);
    return value(i, j, k) || Math.max(value(i - 1, j, k), value(i + 1, j, k), value(i, j - 1, k), value(i, j + 1, k),
                                      value(i, j, k - 1), value(i, j, k + 1));
  };
  return fields;
}
