// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Horizontal slice through the distance field: distance to the nearest surface at each position.
import * as THREE from 'three';
import { element, slider } from './dom.js';
import { away, kBehindColor, legend } from './ramp.js';
import { height, length } from './words.js';

const kContourSpacing = 0.25;  // meters between contour lines

export class Slice {
  /** `fields()` returns a promise of the map's fields; `level`: of the floor, in the three.js world. */
  constructor(scene, fields, level) {
    Object.assign(this, { scene, fields, level });
    this.details = element('div', {});
    this.body = element('div', {}, element('p', { className: 'hint' }, 'Distance to the nearest surface at each place, for robots. Unobserved space is left out.'), this.details);
  }

  async start() {
    this.isOn = true;
    this.details.textContent = 'Fetching the field …';
    try {
      const fields = await this.fields();
      if (this.isOn) this.show(fields);
    } catch (error) {
      this.details.replaceChildren(element('p', { className: 'warning' }, `The field cannot be shown: ${error.message}`));
    }
  }

  show(fields) {
    const { size: [nx, ny, nz], origin: [ox, oy, oz], spacing } = fields;
    // Layers count downward; heights are above the floor.
    const heightOf = (layer) => -(oy + layer * spacing) - this.level;
    this.texture = new THREE.DataTexture(new Uint8Array(4 * nx * nz), nx, nz);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.texture.magFilter = THREE.LinearFilter;
    const [x0, x1, z0, z1] = [ox - spacing / 2, ox + (nx - 0.5) * spacing, oz - spacing / 2, oz + (nz - 0.5) * spacing];
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([x0, 0, z0, x1, 0, z0, x1, 0, z1, x0, 0, z1]), 3));
    geometry.setAttribute('uv', new THREE.BufferAttribute(new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.plane = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({
      map: this.texture, transparent: true, opacity: 0.75, side: THREE.DoubleSide, depthWrite: false, clippingPlanes: this.scene.clipping }));
    this.scene.world.add(this.plane);
    const highest = heightOf(0), lowest = heightOf(ny - 1), set = (above) => this.paint(fields, Math.round((-(above + this.level) - oy) / spacing));
    const middle = Math.min(Math.max(0.5, lowest), highest);
    this.slider = slider({ label: 'Above the floor', min: lowest, max: highest, step: spacing, value: middle, show: height, input: set });
    this.details.replaceChildren(this.slider, legend(away, 'at the surface', length(fields.maxDistance)),
                              element('p', { className: 'hint' }, `A line every ${length(kContourSpacing)}; red is behind a surface.`));
    set(middle);
  }

  paint(fields, layer) {
    const { size: [nx, ny, nz], origin, spacing } = fields, { data } = this.texture.image;
    const j = Math.min(Math.max(layer, 0), ny - 1);
    for (let k = 0; k < nz; ++k)
      for (let i = 0; i < nx; ++i) {
        const at = 4 * (i + nx * k), distance = fields.meters(fields.distance[i + nx * (j + ny * k)]);
        if (distance == null) {
          data[at + 3] = 0;
          continue;
        }
        const line = distance > 0 && distance % kContourSpacing < 0.5 * spacing ? 0.75 : 1;
        const [r, g, b] = distance < 0 ? kBehindColor : away(distance / fields.maxDistance);
        data.set([r * line, g * line, b * line, 255], at);
      }
    this.plane.position.y = origin[1] + j * spacing;
    this.texture.needsUpdate = true;
    this.scene.isStale = true;
  }

  end() {
    this.isOn = false;
    if (!this.plane) return;
    this.plane.removeFromParent();
    this.plane.geometry.dispose();
    this.texture.dispose();
    this.plane = null;
    this.scene.isStale = true;
  }
}
