// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Loads FILE.glb with three.js' own loader, without a page and thus without textures, and prints the contents as JSON.
// node tests/system/clients/three_load.mjs FILE.glb
import { readFileSync } from 'node:fs';
const three = (file) => import(new URL(`../../support/node_modules/three/${file}`, import.meta.url));
const THREE = await three('build/three.module.js');
const { GLTFLoader } = await three('examples/jsm/loaders/GLTFLoader.js');
const { MeshoptDecoder } = await three('examples/jsm/libs/meshopt_decoder.module.js');

const bytes = readFileSync(process.argv[2]);
const gltf = await new GLTFLoader()
  .setMeshoptDecoder(MeshoptDecoder)
  .parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), '');
const box = new THREE.Box3().setFromObject(gltf.scene, true);
const told = { vertices: 0, triangles: 0, low: box.min.toArray(), high: box.max.toArray(), colored: false };
gltf.scene.traverse((node) => {
  if (!node.isMesh) return;
  told.vertices += node.geometry.attributes.position.count;
  told.triangles += node.geometry.index.count / 3;
  told.colored ||= 'color' in node.geometry.attributes;
});
console.log('TOLD ' + JSON.stringify(told));
