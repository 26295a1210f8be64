// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads a USDZ file with the USDLoader of three.js; prints a line `vertices triangles x y z width height depth texture`
// per mesh: its bounds in meters, y up, and 1 with a texture.
import { readFile } from 'node:fs/promises';

// The loader decodes images by the browser's: here only their presence counts.
globalThis.document = { createElementNS: () => ({ addEventListener() {}, removeEventListener() {} }) };
const THREE = await import('three');
const { USDLoader } = await import('three/examples/jsm/loaders/USDLoader.js');

const bytes = await readFile(process.argv[2]);
for (let at = 0; bytes.readUInt32LE(at) === 0x04034b50;) {  // stored, and aligned as the format demands
  const begin = at + 30 + bytes.readUInt16LE(at + 26) + bytes.readUInt16LE(at + 28);
  if (bytes.readUInt16LE(at + 8) !== 0 || begin % 64 !== 0) throw new Error(`file at ${at} is compressed or not aligned`);
  at = begin + bytes.readUInt32LE(at + 18);
}
const scene = new USDLoader().parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
scene.updateMatrixWorld(true);
scene.traverse((mesh) => {
  if (!mesh.isMesh) return;
  const { geometry, material } = mesh, box = new THREE.Box3().setFromObject(mesh), size = box.getSize(new THREE.Vector3());
  const triangles = (geometry.index?.count ?? geometry.attributes.position.count) / 3;
  console.log([geometry.attributes.position.count, triangles, ...box.min.toArray().map((v) => v.toFixed(4)),
    ...size.toArray().map((v) => v.toFixed(4)), material.map && geometry.attributes.uv ? 1 : 0].join(' '));
});
process.exit(0);
