// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A building as 3D Tiles: loads the visible tiles at the required resolution, and unloads tiles unused for a time.
import { TilesRenderer } from '3d-tiles-renderer/three';
import * as THREE from 'three';
import { gltfLoader } from './model.js';

const kError = 6;                // maximum screen-space error in pixels
/**
 * Memory budget for meshes and textures in bytes; the page uses up to 500 MB with it. Larger views are shown coarser.
 */
const kMaxBytes = 96 * 2 ** 20;
const kKeptShare = 0.8;          // share of kMaxBytes kept after an unload
const kErrorFactor = 1.1;        // error factor between updates
const kMaxError = 16 * kError;   // bound, since a tile around the camera never meets its error
const kLoaded = 4, kFailed = 5;  // states of 3d-tiles-renderer

/** Frees the image of a texture after its upload to the GPU. */
function forgetImage(texture) {
  if (texture) texture.onUpdate = () => texture.image.close?.();
}

/** Tilesets have z up. */
const kUpright = new THREE.Matrix4().makeRotationX(-Math.PI / 2);

export class Tiles {
  /** `adopt(mesh)` is called for each loaded mesh, `show(mesh)` before it becomes visible again. */
  constructor(url, { adopt, show }) {
    const tiles = this.tiles = new TilesRenderer(url);
    tiles.errorTarget = this.error = kError;
    tiles.lruCache.maxBytesSize = kMaxBytes;
    tiles.lruCache.minBytesSize = kKeptShare * kMaxBytes;
    tiles.manager.addHandler(/\.glb$/, gltfLoader());
    this.failed = [];
    this.isWaiting = true;  // an update is due
    const each = (scene, then) => scene.traverse((node) => { if (node.isMesh) then(node); });
    tiles.addEventListener('load-model', ({ scene }) => each(scene, (mesh) => {
      forgetImage(mesh.material.map);
      adopt(mesh);
    }));
    tiles.addEventListener('dispose-model', ({ scene }) => each(scene, (mesh) => mesh.userData.textured?.dispose()));
    tiles.addEventListener('tile-visibility-change', ({ scene, visible }) => {
      if (visible) each(scene, show);
      this.hasChanged = true;
    });
    tiles.addEventListener('needs-update', () => { this.isWaiting = true; });
    this.known = new Promise((resolve, reject) => {
      tiles.addEventListener('load-root-tileset', ({ tileset }) => { this.setUpright(tileset.root); resolve(); });
      tiles.addEventListener('load-error', ({ tile, error, url: of }) => {
        this.failed.push(`${of}: ${error.message}`);
        this.onFailed?.();
        if (!tile) reject(error);
      });
    });
  }

  get group() { return this.tiles.group; }

  /** Centers the tileset at its own origin, independent of its location on the Earth. */
  setUpright({ transform }) {
    const away = transform ? new THREE.Matrix4().fromArray(transform).invert() : new THREE.Matrix4();
    this.group.matrixAutoUpdate = false;
    this.group.matrix.multiplyMatrices(kUpright, away);
    this.group.updateMatrixWorld(true);
  }

  /** Bounds of the tileset. */
  get box() {
    const box = new THREE.Box3(), turned = new THREE.Matrix4();
    if (this.tiles.getOrientedBoundingBox(box, turned)) box.applyMatrix4(turned.premultiply(this.group.matrixWorld));
    return box;
  }

  /** Active meshes, visible or outside the view. */
  *meshes() {
    for (const { engineData } of this.tiles.activeTiles) {
      const found = [];
      engineData.scene?.traverse((node) => { if (node.isMesh) found.push(node); });
      yield* found;
    }
  }

  /** Selects tiles to show and load; returns true if a redraw is needed. */
  update(camera, renderer) {
    camera.updateMatrixWorld();
    const view = [camera.matrixWorld, camera.projectionMatrix].map(({ elements }) => elements.join()).join() + renderer.domElement.height;
    if (!this.isWaiting && view === this.view) return false;
    const hasMoved = view !== this.view;
    Object.assign(this, { view, isWaiting: false, hasChanged: false });
    for (const other of [...this.tiles.cameras]) if (other !== camera) this.tiles.deleteCamera(other);
    this.tiles.setCamera(camera);
    this.tiles.setResolutionFromRenderer(camera, renderer);
    this.tiles.update();
    this.adaptError(hasMoved);
    if (this.hasChanged) this.onChange?.();
    return this.hasChanged;
  }

  /** Prefers a complete view to a fine view: without memory left, the error is raised until the camera moves. */
  adaptError(hasMoved) {
    const { tiles } = this, before = tiles.errorTarget;
    if (hasMoved) tiles.errorTarget = this.error;
    else if (tiles.stats.refused > 0) tiles.errorTarget = Math.min(kMaxError, kErrorFactor * before);
    this.isWaiting ||= tiles.errorTarget !== before;
  }

  /** True if the complete view is loaded, at any resolution. */
  get isComplete() {
    const isLoaded = ({ traversal, internal, children }) => {
      if (!traversal || !internal) return false;
      if (!traversal.inFrustum) return true;
      if (internal.hasContent && ![kLoaded, kFailed].includes(internal.loadingState)) return false;
      return internal.hasRenderableContent || children.every(isLoaded);
    };
    return Boolean(this.tiles.root) && isLoaded(this.tiles.root);
  }

  /** True if no loading is in progress. */
  get isSettled() {
    const { queued, downloading, parsing } = this.tiles.stats;
    return this.isComplete && !this.isWaiting && queued + downloading + parsing === 0;
  }

  /** Bytes of loaded tiles, as estimated by the library. */
  get bytes() { return this.tiles.lruCache.cachedBytes; }
}
