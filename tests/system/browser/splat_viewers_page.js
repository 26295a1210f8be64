// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Opens splats in viewers of other programs, Spark and three.js, and a mesh for comparison.
import { SparkRenderer, SplatMesh } from '@sparkjsdev/spark';
import * as THREE from 'three';
import * as WEBGPU from 'three/webgpu';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFGaussianSplatLoaderExtension } from 'three/addons/loaders/GLTFGaussianSplatLoaderExtension.js';
import { GaussianSplatPLYLoader } from 'three/addons/loaders/GaussianSplatPLYLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { SPZLoader } from 'three/addons/loaders/SPZLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GaussianSplat } from 'three/addons/objects/GaussianSplat.js';

const kFrames = 12, kFrameTime = 100;  // pictures until the splats are sorted; milliseconds

const loader = () => new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).setDRACOLoader(new DRACOLoader().setDecoderPath('/draco/'));

/** World of three.js from a file's axes: .ply is in the map's world, x right, y down. */
const upright = (object, url) => {
  if (url.endsWith('.ply')) object.quaternion.set(1, 0, 0, 0);
  return object;
};

const viewers = {
  async mesh(url, scene) {
    scene.add((await loader().loadAsync(url)).scene);
  },
  async spark(url, scene, renderer) {
    scene.add(new SparkRenderer({ renderer }));
    const splats = upright(new SplatMesh({ url }), url);
    await splats.initialized;
    scene.add(splats);
  },
  async three(url, scene) {
    if (url.endsWith('.glb')) {
      const gltf = loader().register((parser) => new GLTFGaussianSplatLoaderExtension(parser));
      scene.add((await gltf.loadAsync(url)).scene);
    } else {
      const splats = url.endsWith('.spz') ? new SPZLoader() : new GaussianSplatPLYLoader();
      scene.add(upright(new GaussianSplat(await splats.loadAsync(url)), url));
    }
  },
};

async function rendererOf(name) {
  if (name !== 'three') return new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
  const renderer = new WEBGPU.WebGPURenderer({ antialias: false, forceWebGL: true });
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;  // its splats are sRGB already
  await renderer.init();
  return renderer;
}

/** Draws a file by a viewer from a camera: `position`, `quaternion` (x, y, z, w; y up), vertical `fov` in degrees. Returns R, G, B and A of `width` x `height` cells. */
window.draw = async (name, url, { position, quaternion, fov, aspect }, width, height) => {
  const renderer = await rendererOf(name), canvas = renderer.domElement, scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(fov, aspect, 0.05, 100);
  camera.position.fromArray(position);
  camera.quaternion.fromArray(quaternion);
  camera.updateMatrixWorld();
  renderer.setPixelRatio(1);
  renderer.setSize(Math.round(480 * aspect), 480);
  renderer.setClearColor(0x000000, 1);
  document.body.replaceChildren(canvas);
  await viewers[name](url, scene, renderer);
  for (let i = 0; i < kFrames; ++i) {
    await renderer.render(scene, camera);
    await new Promise((resolve) => setTimeout(resolve, kFrameTime));
  }
  await renderer.render(scene, camera);
  const small = Object.assign(document.createElement('canvas'), { width, height }), context = small.getContext('2d');
  context.drawImage(canvas, 0, 0, width, height);
  return [...context.getImageData(0, 0, width, height).data];
};
