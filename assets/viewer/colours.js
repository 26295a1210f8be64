// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Coloring of the surface: by texture, by shape, or by a value at each vertex with a legend.
import * as THREE from 'three';
import { choice, element } from './dom.js';
import { legend, viridis } from './ramp.js';
import { height, metres, millimetres } from './words.js';

const kPoses = 150;  // maximum number of path poses for distances
const kLinear = Float32Array.from({ length: 256 }, (_, c) => new THREE.Color().setRGB(c / 255, 0, 0, THREE.SRGBColorSpace).r);
const kNothing = [90, 95, 102];
const kSigma = '_sigma';  // glTF attribute _SIGMA: meters, of an adjusted map

/** Quantile of sorted values. */
const quantile = (values, share) => values[Math.min(values.length - 1, Math.floor(share * values.length))];

export class Colours {
  /**
   * `fields()` returns a promise of the map's fields, or null; `level`: of the floor; `path`: camera positions,
   * upright.
   */
  constructor(scene, { fields, hasFields, level, path }) {
    Object.assign(this, { scene, fields, level, path, shown: 'colour' });
    const kinds = [['colour', 'As it looks'], ['shape', 'Shape'], ['height', 'Height'], ['normal', 'Direction'], ['reach', 'Distance'],
                   ...(hasFields ? [['weight', 'Seen how often'], ['sigma', 'Uncertainty']] : []),
                   ...([...scene.meshes()].some(({ geometry }) => geometry.hasAttribute(kSigma)) ? [['adjusted', 'Uncertainty, adjusted']] : [])];
    this.choice = choice('Colours', kinds, 'colour', (kind) => this.set(kind));
    this.told = element('div', {}, '');
    this.body = element('div', {}, this.choice, this.told);
  }

  start() { }
  end() { this.set('colour'); }

  async set(kind) {
    this.shown = kind;
    this.choice.set(kind);
    this.onSet?.(kind);
    this.told.replaceChildren();
    if (kind === 'colour' || kind === 'shape') {
      for (const mesh of this.scene.meshes()) this.restore(mesh);
      return this.scene.setLook(kind);
    }
    try {
      const fields = kind === 'weight' || kind === 'sigma' ? await this.fields() : null;
      if (this.shown !== kind) return;
      this.told.replaceChildren(...this[kind](fields));
      this.scene.setLook(kind === 'normal' ? 'normal' : 'tinted');
    } catch (error) {
      this.told.replaceChildren(element('p', { className: 'warning' }, `This cannot be shown: ${error.message}`));
    }
  }

  restore({ geometry, userData }) {
    if (!userData.isTinted) return;
    userData.isTinted = false;
    if (userData.colour) geometry.setAttribute('color', userData.colour);
    else geometry.deleteAttribute('color');
  }

  /**
   * `colourOf(place, normal, geometry, i)` returns the color bytes of a vertex at its position in the three.js world.
   */
  tint(colourOf, needsNormals = false) {
    const place = new THREE.Vector3(), normal = new THREE.Vector3(), turn = new THREE.Matrix3();
    for (const mesh of this.scene.meshes()) {
      const { geometry, userData, matrixWorld } = mesh, { position } = geometry.attributes, colours = new Float32Array(3 * position.count);
      if (needsNormals && !geometry.hasAttribute('normal')) geometry.computeVertexNormals();
      if (needsNormals) turn.getNormalMatrix(matrixWorld);
      for (let i = 0; i < position.count; ++i) {
        place.fromBufferAttribute(position, i).applyMatrix4(matrixWorld);
        if (needsNormals) normal.fromBufferAttribute(geometry.attributes.normal, i).applyMatrix3(turn).normalize();
        const [r, g, b] = colourOf(place, normal, geometry, i);
        colours[3 * i] = kLinear[r & 255];
        colours[3 * i + 1] = kLinear[g & 255];
        colours[3 * i + 2] = kLinear[b & 255];
      }
      if (!userData.isTinted) userData.colour = geometry.getAttribute('color');
      userData.isTinted = true;
      geometry.setAttribute('color', new THREE.BufferAttribute(colours, 3));
    }
  }

  /** Colors vertices by `valueOf(place, geometry, i)`, from low to high; null is gray. */
  byValue(valueOf, show, lowest) {
    const samples = [], place = new THREE.Vector3();
    for (const mesh of this.scene.meshes()) {
      const { position } = mesh.geometry.attributes, step = Math.max(1, Math.floor(position.count / 5000));
      for (let i = 0; i < position.count; i += step) {
        const value = valueOf(place.fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld), mesh.geometry, i);
        if (value != null) samples.push(value);
      }
    }
    samples.sort((a, b) => a - b);
    if (samples.length === 0) throw new Error('the map holds nothing of it here');
    const low = lowest ?? quantile(samples, 0.01), high = Math.max(quantile(samples, 0.99), low + 1e-6);
    this.tint((at, _, geometry, i) => {
      const value = valueOf(at, geometry, i);
      return value == null ? kNothing : viridis((value - low) / (high - low));
    });
    return [legend(viridis, show(low), show(high))];
  }

  height() { return [...this.byValue(({ y }) => y - this.level, height), element('p', { className: 'hint' }, 'Above the floor.')]; }

  normal() {
    this.tint((_, n) => [n.x, n.y, n.z].map((c) => 127.5 + 127.5 * c), true);
    return [element('p', { className: 'hint' }, 'Where the surface faces: green up, red to the right, blue towards where the camera began.')];
  }

  reach() {
    const step = Math.max(1, Math.ceil(this.path.length / kPoses)), eyes = this.path.filter((_, i) => i % step === 0);
    if (eyes.length === 0) throw new Error('the map has no path of the camera');
    const nearest = (place) => Math.sqrt(eyes.reduce((least, eye) => Math.min(least, eye.distanceToSquared(place)), Infinity));
    return [...this.byValue(nearest, metres), element('p', { className: 'hint' }, 'From the nearest place of the camera: what is far is less exact.')];
  }

  weight(fields) {
    const told = this.byValue(({ x, y, z }) => fields.at(fields.weight, x, -y, -z) || null, (v) => (v >= 254.5 ? '255 or more' : String(Math.round(v))), 1);
    return [...told, element('p', { className: 'hint' }, 'Observations of the place. What was seen once or twice is worth another look.')];
  }

  sigma(fields) {
    const told = this.byValue(({ x, y, z }) => { const v = fields.at(fields.sigma, x, -y, -z); return v ? v * 1e-4 : null; }, metres, 0);
    return [...told, element('p', { className: 'hint' }, 'Standard deviation of the surface by the noise of its measurements, as if all poses were exact.')];
  }

  adjusted() {
    const told = this.byValue((_, geometry, i) => geometry.getAttribute(kSigma)?.getX(i), millimetres);
    return [...told, element('p', { className: 'hint' }, 'Standard deviation of the surface along its normal, as the adjustment of all keyframes tells it. What that did not see has the largest.')];
  }
}
