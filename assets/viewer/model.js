// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
import * as THREE from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const kModes = { 33071: THREE.ClampToEdgeWrapping, 33648: THREE.MirroredRepeatWrapping, 10497: THREE.RepeatWrapping };

/** Gives textures whose images are decoded beside what goes on; `waiting` are promises of them. */
const later = (waiting) => (parser) => ({
  name: 'CAIRN_textures_later',
  loadTexture(index) {
    const { extensions, source, sampler } = parser.json.textures[index], image = parser.json.images?.[source];
    if (extensions || image?.bufferView === undefined) return null;  // as the loader does it
    const { wrapS = 10497, wrapT = 10497 } = parser.json.samplers?.[sampler] ?? {};
    const texture = Object.assign(new THREE.Texture(), { flipY: false, wrapS: kModes[wrapS], wrapT: kModes[wrapT] });
    const decode = async () => {
      const bytes = await parser.getDependency('bufferView', image.bufferView);
      texture.image = await createImageBitmap(new Blob([bytes], { type: image.mimeType }), { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
    };
    waiting.push(decode());
    return Promise.resolve(texture);
  },
});

export const gltfLoader = () => new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);

/** What a .glb holds; y is up in it. `textured` promises that its images are there, too. */
export async function loadModel(bytes) {
  const waiting = [];
  const { scene } = await gltfLoader().register(later(waiting)).parseAsync(bytes, '');
  const textured = Promise.all(waiting).then(({ length }) => length > 0 && performance.mark('texture'));
  textured.catch(() => {});  // told to who waits for it
  return { model: scene, textured };
}
