// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
import * as THREE from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const kModes = { 33071: THREE.ClampToEdgeWrapping, 33648: THREE.MirroredRepeatWrapping, 10497: THREE.RepeatWrapping };

/** glTF plugin that decodes texture images asynchronously; their promises are added to `waiting`. */
const later = (waiting) => (parser) => ({
  name: 'CAIRN_textures_later',
  loadTexture(index) {
    const { extensions, source, sampler } = parser.json.textures[index], image = parser.json.images?.[source];
    if (extensions || image?.bufferView === undefined) return null;  // default loading
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

/** Loads a .glb, with y up. `textured` resolves when its images are loaded. */
export async function loadModel(bytes) {
  const waiting = [];
  const { scene } = await gltfLoader().register(later(waiting)).parseAsync(bytes, '');
  const textured = Promise.all(waiting).then(({ length }) => length > 0 && performance.mark('texture'));
  textured.catch(() => {});  // handled by its consumer
  return { model: scene, textured };
}
