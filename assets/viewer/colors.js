// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Coloring of the surface: by texture, by shape, or by a value at each vertex with a legend.
import * as THREE from 'three';
import { choice, element } from './dom.js';
import { legend, viridis } from './ramp.js';
import { height, meters, millimeters } from './words.js';

const kMaxPoses = 150;  // maximum number of path poses for distances
const kLinear = Float32Array.from({ length: 256 }, (_, c) => new THREE.Color().setRGB(c / 255, 0, 0, THREE.SRGBColorSpace).r);
const kNoValue = [90, 95, 102];
const kSigma = '_sigma';  // glTF attribute _SIGMA: meters, of an adjusted map

/** Quantile of sorted values. */
const quantile = (values, share) => values[Math.min(values.length - 1, Math.floor(share * values.length))];

export class Colors {
  /**
   * `fields()` returns a promise of the map's fields, or null; `level`: of the floor; `path`: camera positions,
   * upright.
   */
  constructor(scene, { fields, hasFields, level, path }) {
    Object.assign(this, { scene, fields, level, path, shown: 'color' });
    const kinds = [['color', 'Original colors'], ['shape', 'Shape'], ['height', 'Height'], ['normal', 'Direction'], ['reach', 'Distance'],
                   ...(hasFields ? [['weight', 'Observations'], ['sigma', 'Uncertainty']] : []),
                   ...([...scene.meshes()].some(({ geometry }) => geometry.hasAttribute(kSigma)) ? [['adjusted', 'Uncertainty, adjusted']] : [])];
    this.choice = choice('Colors', kinds, 'color', (kind) => this.set(kind));
    this.details = element('div', {}, '');
    this.body = element('div', {}, this.choice, this.details);
  }

  start() { }
  end() { this.set('color'); }

  async set(kind) {
    this.shown = kind;
    this.choice.set(kind);
    this.onSet?.(kind);
    this.details.replaceChildren();
    if (kind === 'color' || kind === 'shape') {
      for (const mesh of this.scene.meshes()) this.restore(mesh);
      return this.scene.setLook(kind);
    }
    try {
      const fields = kind === 'weight' || kind === 'sigma' ? await this.fields() : null;
      if (this.shown !== kind) return;
      this.details.replaceChildren(...this[kind](fields));
      this.scene.setLook(kind === 'normal' ? 'normal' : 'tinted');
    } catch (error) {
      this.details.replaceChildren(element('p', { className: 'warning' }, `This cannot be shown: ${error.message}`));
    }
  }

  restore({ geometry, userData }) {
    if (!userData.isTinted) return;
    userData.isTinted = false;
    if (userData.color) geometry.setAttribute('color', userData.color);
    else geometry.deleteAttribute('color');
  }

  /**
   * `colorOf(place, normal, geometry, i)` returns the color bytes of a vertex at its position in the three.js world.
   */
  tint(colorOf, needsNormals = false) {
    const place = new THREE.Vector3(), normal = new THREE.Vector3(), turn = new THREE.Matrix3();
    for (const mesh of this.scene.meshes()) {
      const { geometry, userData, matrixWorld } = mesh, { position } = geometry.attributes, colors = new Float32Array(3 * position.count);
      if (needsNormals && !geometry.hasAttribute('normal')) geometry.computeVertexNormals();
      if (needsNormals) turn.getNormalMatrix(matrixWorld);
      for (let i = 0; i < position.count; ++i) {
        place.fromBufferAttribute(position, i).applyMatrix4(matrixWorld);
        if (needsNormals) normal.fromBufferAttribute(geometry.attributes.normal, i).applyMatrix3(turn).normalize();
        const [r, g, b] = colorOf(place, normal, geometry, i);
        colors[3 * i] = kLinear[r & 255];
        colors[3 * i + 1] = kLinear[g & 255];
        colors[3 * i + 2] = kLinear[b & 255];
      }
      if (!userData.isTinted) userData.color = geometry.getAttribute('color');
      userData.isTinted = true;
      geometry.setAttribute('color', new THREE.BufferAttribute(colors, 3));
    }
  }

  /** Colors vertices by `valueOf(place, geometry, i)`, from low to high; null is gray. */
  byValue(valueOf, show, min) {
    const samples = [], place = new THREE.Vector3();
    for (const mesh of this.scene.meshes()) {
      const { position } = mesh.geometry.attributes, step = Math.max(1, Math.floor(position.count / 5000));
      for (let i = 0; i < position.count; i += step) {
        const value = valueOf(place.fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld), mesh.geometry, i);
        if (value != null) samples.push(value);
      }
    }
    samples.sort((a, b) => a - b);
    if (samples.length === 0) throw new Error('the map has no such values here');
    const low = min ?? quantile(samples, 0.01), high = Math.max(quantile(samples, 0.99), low + 1e-6);
    this.tint((at, _, geometry, i) => {
      const value = valueOf(at, geometry, i);
      return value == null ? kNoValue : viridis((value - low) / (high - low));
    });
    return [legend(viridis, show(low), show(high))];
  }

  height() { return [...this.byValue(({ y }) => y - this.level, height), element('p', { className: 'hint' }, 'Above the floor.')]; }

  normal() {
    this.tint((_, n) => [n.x, n.y, n.z].map((c) => 127.5 + 127.5 * c), true);
    return [element('p', { className: 'hint' }, 'Surface normal: green up, red to the right, blue towards the start of the camera.')];
  }

  reach() {
    const step = Math.max(1, Math.ceil(this.path.length / kMaxPoses)), cameras = this.path.filter((_, i) => i % step === 0);
    if (cameras.length === 0) throw new Error('the map has no camera path');
    const nearest = (place) => Math.sqrt(cameras.reduce((min, camera) => Math.min(min, camera.distanceToSquared(place)), Infinity));
    return [...this.byValue(nearest, meters), element('p', { className: 'hint' }, 'From the nearest camera position. Distant surfaces are less accurate.')];
  }

  weight(fields) {
    const legends = this.byValue(({ x, y, z }) => fields.at(fields.weight, x, -y, -z) || null, (v) => (v >= 254.5 ? '255 or more' : String(Math.round(v))), 1);
    return [...legends, element('p', { className: 'hint' }, 'Number of observations. Record places with only one or two again.')];
  }

  sigma(fields) {
    const legends = this.byValue(({ x, y, z }) => { const v = fields.at(fields.sigma, x, -y, -z); return v ? v * 1e-4 : null; }, meters, 0);
    return [...legends, element('p', { className: 'hint' }, 'Standard deviation of the surface due to measurement noise, without errors of the poses.')];
  }

  adjusted() {
    const legends = this.byValue((_, geometry, i) => geometry.getAttribute(kSigma)?.getX(i), millimeters);
    return [...legends, element('p', { className: 'hint' }, 'Standard deviation of the surface along its normal, from the adjustment of all keyframes. Surfaces not seen by it have the largest value.')];
  }
}
