// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A building as 3D Tiles: what is in sight is loaded, as fine as one can see it, and what was not for long goes.
import { TilesRenderer } from '3d-tiles-renderer/three';
import * as THREE from 'three';
import { gltfLoader } from './model.js';

const kError = 6;                // pixels that the surface may lie beside where it is
/** Bytes of meshes and textures, with which a page takes up to 500 MB; what would need more is shown coarser. */
const kMost = 96 * 2 ** 20;
const kKept = 0.8;               // of these, once some must go
const kCoarser = 1.1;            // times the error, from one look to the next
const kCoarsest = 16 * kError;   // a tile around the camera is never fine enough
const kLoaded = 4, kFailed = 5;  // states of 3d-tiles-renderer

/** Once a texture is with the graphics card, its image in the page's own memory is of no more use. */
function forgetImage(texture) {
  if (texture) texture.onUpdate = () => texture.image.close?.();
}

/** Tilesets have z up. */
const kUpright = new THREE.Matrix4().makeRotationX(-Math.PI / 2);

export class Tiles {
  /** `adopt(mesh)` is called for each mesh that comes, `show(mesh)` before it is in the picture again. */
  constructor(url, { adopt, show }) {
    const tiles = this.tiles = new TilesRenderer(url);
    tiles.errorTarget = this.error = kError;
    tiles.lruCache.maxBytesSize = kMost;
    tiles.lruCache.minBytesSize = kKept * kMost;
    tiles.manager.addHandler(/\.glb$/, gltfLoader());
    this.failed = [];
    this.isWaiting = true;  // for the next look at what there is to load
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

  /** Around its own origin, wherever on the Earth it is. */
  setUpright({ transform }) {
    const away = transform ? new THREE.Matrix4().fromArray(transform).invert() : new THREE.Matrix4();
    this.group.matrixAutoUpdate = false;
    this.group.matrix.multiplyMatrices(kUpright, away);
    this.group.updateMatrixWorld(true);
  }

  /** Of all of it. */
  get box() {
    const box = new THREE.Box3(), turned = new THREE.Matrix4();
    if (this.tiles.getOrientedBoundingBox(box, turned)) box.applyMatrix4(turned.premultiply(this.group.matrixWorld));
    return box;
  }

  /** What one would see if one turned around, as far as it is there. */
  *meshes() {
    for (const { engineData } of this.tiles.activeTiles) {
      const found = [];
      engineData.scene?.traverse((node) => { if (node.isMesh) found.push(node); });
      yield* found;
    }
  }

  /** Chooses what to show and what to load; returns whether another picture is due. */
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
    this.spare(hasMoved);
    if (this.hasChanged) this.onChange?.();
    return this.hasChanged;
  }

  /**
   * All of what is in sight is worth more than some of it as fine as can be: where there is no room, it is coarser, until one
   * looks elsewhere.
   */
  spare(hasMoved) {
    const { tiles } = this, before = tiles.errorTarget;
    if (hasMoved) tiles.errorTarget = this.error;
    else if (tiles.stats.refused > 0) tiles.errorTarget = Math.min(kCoarsest, kCoarser * before);
    this.isWaiting ||= tiles.errorTarget !== before;
  }

  /** Whether all that is in sight is in the picture, however coarse. */
  get isWhole() {
    const isThere = ({ traversal, internal, children }) => {
      if (!traversal || !internal) return false;
      if (!traversal.inFrustum) return true;
      if (internal.hasContent && ![kLoaded, kFailed].includes(internal.loadingState)) return false;
      return internal.hasRenderableContent || children.every(isThere);
    };
    return Boolean(this.tiles.root) && isThere(this.tiles.root);
  }

  /** Whether nothing is on its way. */
  get isSettled() {
    const { queued, downloading, parsing } = this.tiles.stats;
    return this.isWhole && !this.isWaiting && queued + downloading + parsing === 0;
  }

  /** Of what is kept, by what the library reckons. */
  get bytes() { return this.tiles.lruCache.cachedBytes; }
}
