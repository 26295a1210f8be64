// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads the binary messages described in src/view/messages.hpp.

const kPart = 1, kImage = 2, kPath = 3;

export function readMessage(buffer) {
  const words = new DataView(buffer);
  const u32 = (i) => words.getUint32(4 * i, true), i32 = (i) => words.getInt32(4 * i, true),
        f32 = (i) => words.getFloat32(4 * i, true);
  switch (u32(0)) {
    case kPart: {
      const vertices = u32(10), indices = u32(11);
      let at = 48;
      const take = (Type, count) => {
        const array = new Type(buffer, at, count);
        at += array.byteLength;
        return array;
      };
      return {
        kind: 'part', epoch: u32(1), submap: i32(2), cell: [i32(3), i32(4), i32(5)].join(' '),
        origin: [f32(6), f32(7), f32(8)], size: f32(9),
        positions: take(Uint16Array, 4 * vertices), colors: take(Uint8Array, 4 * vertices),
        normals: take(Int8Array, 4 * vertices),
        indices: vertices <= 0xffff ? take(Uint16Array, indices) : take(Uint32Array, indices),
      };
    }
    case kImage:
      return { kind: 'image', of: u32(1) === 0 ? 'color' : 'depth', jpeg: new Blob([new Uint8Array(buffer, 8)], { type: 'image/jpeg' }) };
    case kPath:
      return { kind: 'path', epoch: u32(1), points: new Float32Array(buffer, 12, 4 * u32(2)) };
    default:
      throw new Error(`unknown message ${u32(0)}`);
  }
}
