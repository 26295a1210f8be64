// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Opens exported files with the usual web loaders: three.js' GLTFLoader, and 3d-tiles-renderer.
import { TilesRenderer } from '3d-tiles-renderer';
import * as THREE from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(1000, 640);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(60, 1000 / 640, 0.02, 500);
const loader = new GLTFLoader()
  .setMeshoptDecoder(MeshoptDecoder)
  .setDRACOLoader(new DRACOLoader().setDecoderPath('/draco/'));

function sceneWith(object) {
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xffffff);
  scene.add(object, new THREE.HemisphereLight(0xffffff, 0x777777, 2.4));
  return scene;
}

function lookAt(box) {
  const middle = box.getCenter(new THREE.Vector3()), radius = box.getSize(new THREE.Vector3()).length() / 2;
  camera.position.copy(middle).add(new THREE.Vector3(0.25, 0.65, 1).normalize().multiplyScalar(1.3 * radius));
  camera.lookAt(middle);
  camera.updateMatrixWorld();
}

/** Share of the picture that is not background. */
function drawn() {
  const gl = renderer.getContext(), size = renderer.getDrawingBufferSize(new THREE.Vector2());
  const pixels = new Uint8Array(4 * size.x * size.y);
  gl.readPixels(0, 0, size.x, size.y, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) count += pixels[i] + pixels[i + 1] + pixels[i + 2] < 740;
  return count / (size.x * size.y);
}

window.openGltf = async (url) => {
  const start = performance.now();
  const gltf = await loader.loadAsync(url);
  const summary = { triangles: 0, textured: 0, lines: 0, cameras: 0, meshes: 0, extras: gltf.asset.extras };
  const box = new THREE.Box3();
  gltf.scene.traverse((node) => {
    if (node.isLine) ++summary.lines;
    if (node.isCamera) ++summary.cameras;
    if (!node.isMesh) return;
    ++summary.meshes;
    summary.triangles += node.geometry.index.count / 3;
    summary.textured += Boolean(node.material.map);
    box.expandByObject(node);
  });
  lookAt(box);
  renderer.render(sceneWith(gltf.scene), camera);
  summary.drawn = drawn();
  summary.ms = performance.now() - start;
  return summary;
};

window.openTiles = async (url, errorTarget) => {
  const tiles = new TilesRenderer(url);
  tiles.errorTarget = errorTarget;
  tiles.manager.addHandler(/\.(gltf|glb)$/, loader);
  tiles.setCamera(camera);
  tiles.setResolutionFromRenderer(camera, renderer);
  const scene = sceneWith(tiles.group);
  const failed = [];
  tiles.addEventListener('load-error', (event) => failed.push(String(event.error)));
  camera.position.set(0, 0, 20);
  let quiet = 0, looked = false;
  for (let i = 0; i < 600 && quiet < 10; ++i) {
    const sphere = new THREE.Sphere();
    if (!looked && tiles.getBoundingSphere(sphere) && sphere.radius > 0) {
      // Tilesets are z-up.
      camera.up.set(0, 0, 1);
      camera.position.copy(sphere.center).add(new THREE.Vector3(0.25, -1, 0.65).normalize().multiplyScalar(1.3 * sphere.radius));
      camera.lookAt(sphere.center);
      looked = true;
    }
    camera.updateMatrixWorld();
    tiles.update();
    renderer.render(scene, camera);
    quiet = looked && tiles.stats.downloading + tiles.stats.parsing === 0 ? quiet + 1 : 0;
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
  const summary = { triangles: 0, visible: tiles.visibleTiles.size, failed, drawn: drawn() };
  tiles.forEachLoadedModel((model, tile) => {
    if (tiles.visibleTiles.has(tile)) model.traverse((node) => { if (node.isMesh) summary.triangles += node.geometry.index.count / 3; });
  });
  tiles.dispose();
  camera.up.set(0, 1, 0);
  return summary;
};
