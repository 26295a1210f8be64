// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Feature at a pixel of the view: a corner, an edge, or else the surface.
import * as THREE from 'three';
import { featureNear } from './features.js';

const kSnapDistance = { corner: 16, edge: 11 };  // pixels
/** Offsets to nearby pixels, nearest first. */
const kOffsets = [8, 15].flatMap((far) => [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [far * Math.cos(i * Math.PI / 4), far * Math.sin(i * Math.PI / 4)]));

export class Snap {
  constructor(scene, surface, voxel) { Object.assign(this, { scene, surface, voxel }); }

  /** Pixel position in the view. */
  onScreen(point) {
    const { clientWidth: width, clientHeight: height } = this.scene.element;
    const at = point.clone().project(this.scene.camera);
    return at.z > 1 ? null : [(at.x + 1) * width / 2, (1 - at.y) * height / 2];
  }

  /** Returns true if a feature is within its kind's snapping distance of the pixel x, y. */
  isNearPointer(place, kind, x, y) {
    const at = this.onScreen(place);
    return Boolean(at) && Math.hypot(at[0] - x, at[1] - y) < kSnapDistance[kind];
  }

  /** Meters per pixel at a point. */
  pixelAt(point) {
    const { camera } = this.scene, height = this.scene.element.clientHeight;
    if (camera.isOrthographicCamera) return (camera.top - camera.bottom) / camera.zoom / height;
    return 2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2)) * camera.position.distanceTo(point) / height;
  }

  /** { point, kind: corner, edge or surface }, or null without a surface. */
  find(x, y) {
    const hit = this.surface.pick(x, y);
    const featureAt = (found) => {
      const radius = THREE.MathUtils.clamp(2 * kSnapDistance.corner * this.pixelAt(found.point), 5 * this.voxel, 10 * this.voxel);
      return featureNear(this.surface, found.point, radius, this.voxel, (place, kind) => this.isNearPointer(place, kind, x, y));
    };
    let found = hit && featureAt(hit);
    if (found?.kind === 'corner') return found;
    // Just outside a foreground edge, the ray hits the background, so nearby pixels are tested for foreground features.
    for (const [dx, dy] of kOffsets) {
      const other = this.surface.pick(x + dx, y + dy);
      if (!other || (hit && other.distance > hit.distance - 5 * this.voxel)) continue;
      const before = featureAt(other);
      if (before?.kind === 'corner') return before;
      found ??= before;
    }
    return found ?? (hit && { point: hit.point, kind: 'surface' });
  }
}
