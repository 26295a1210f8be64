// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Measurement of points, distances, heights and areas on the surface, with snapping to corners and edges.
import * as THREE from 'three';
import { choice, element } from './dom.js';
import { icon } from './icons.js';
import { Snap } from './snap.js';
import { meters, squareMeters } from './words.js';

const kMaxClickMotion = 6;  // maximum pointer motion of a click in pixels
const kKinds = [['distance', 'Distance'], ['height', 'Height'], ['area', 'Area'], ['point', 'Point']];
const kPointCount = { distance: 2, height: 2, point: 1, area: Infinity };
const kHints = {
  distance: 'Click two places. Near an edge or a corner the place snaps to it.',
  height: 'Click two places to measure their difference in height.',
  area: 'Click the corners of the area, then the first one again or “Close the area”.',
  point: 'Click a place to read its coordinates.',
};
const kFeatureNames = { corner: 'a corner', edge: 'an edge', surface: 'the surface' };

const areaOf = (points) => {
  const sum = new THREE.Vector3(), product = new THREE.Vector3();
  points.forEach((p, i) => sum.add(product.crossVectors(p, points[(i + 1) % points.length])));
  return sum.length() / 2;
};

/** Position in the map's axes: x right, y down, z forward. */
const coordinates = ({ x, y, z }) => [x, -y, -z].map((v) => v.toFixed(3)).join(', ');

export function valueOf({ kind, points }) {
  switch (kind) {
    case 'distance': return meters(points[0].distanceTo(points[1]));
    case 'height': return meters(Math.abs(points[0].y - points[1].y));
    case 'area': return squareMeters(areaOf(points));
    default: return coordinates(points[0]);
  }
}

export class Measure {
  constructor(scene, surface, voxel) {
    Object.assign(this, { scene, surface, snap: new Snap(scene, surface, voxel), kind: 'distance', done: [], points: [], isOn: false });
    this.group = new THREE.Group();
    scene.scene.add(this.group);
    this.dots = new THREE.PointsMaterial({ size: 9 * scene.renderer.getPixelRatio(), sizeAttenuation: false, depthTest: false });
    this.lines = new THREE.LineBasicMaterial({ depthTest: false });
    for (const { color } of [this.dots, this.lines]) scene.tint(color, 'mark');
    this.labels = element('div', { id: 'labels', aria: { hidden: 'true' } });
    this.cross = element('div', { className: 'cross', hidden: true });
    this.cursor = element('div', { className: 'cursor', hidden: true });
    scene.element.append(this.labels, this.cross, this.cursor);
    this.kinds = choice('What to measure', kKinds, this.kind, (kind) => this.setKind(kind));
    this.hint = element('p', { className: 'hint' });
    this.status = element('p', { className: 'status', aria: { live: 'polite' } });
    this.list = element('ul', { className: 'measured' });
    this.close = element('button', { onclick: () => this.closeArea(), hidden: true }, 'Close the area');
    this.clear = element('button', { onclick: () => this.removeAll(), hidden: true }, 'Remove all');
    this.body = element('div', {}, this.kinds, this.hint, this.close, this.status, this.list, this.clear);
    const canvas = scene.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => { this.pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener('pointerup', (event) => this.onClick(event));
    canvas.addEventListener('pointermove', (event) => this.onMove(event));
    canvas.addEventListener('pointerleave', () => { this.cursor.hidden = true; });
    scene.watchers.add(() => this.placeLabels());
    this.setKind('distance');
  }

  async start() {
    this.isOn = true;
    this.status.textContent = 'Preparing the surface …';
    await this.surface.prepare();
    this.status.textContent = '';
  }

  /** Keeps the measurements in the view. */
  end() {
    this.isOn = false;
    this.points = [];
    this.cursor.hidden = this.cross.hidden = true;
    this.show();
  }

  setKind(kind) {
    this.kind = kind;
    this.points = [];
    this.hint.textContent = kHints[kind];
    this.kinds.set(kind);
    this.show();
  }

  at(event) {
    const box = this.scene.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  onMove(event) {
    if (!this.isOn || event.buttons || event.pointerType !== 'mouse' || this.isSearching) return;
    this.cross.hidden = true;
    this.isSearching = true;
    requestAnimationFrame(() => {
      this.isSearching = false;
      const found = this.isOn && this.surface.parts.length > 0 ? this.snap.find(...this.at(event)) : null, at = found && this.snap.onScreen(found.point);
      this.cursor.hidden = !at;
      if (!at) return;
      this.cursor.dataset.kind = found.kind;
      this.cursor.style.translate = `${at[0]}px ${at[1]}px`;
    });
  }

  async onClick(event) {
    if (!this.isOn || !this.pressed || event.button !== 0) return;
    const moved = Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]);
    this.pressed = null;
    if (moved > kMaxClickMotion) return;
    const at = this.at(event);
    await this.surface.prepare();
    this.take(...at);
  }

  take(x, y) {
    if (this.kind === 'area' && this.points.length > 2) {
      if (this.snap.isNearPointer(this.points[0], 'corner', x, y)) return this.closeArea();
    }
    const found = this.snap.find(x, y);
    if (!found) {
      this.status.textContent = 'No surface at this pixel.';
      return;
    }
    this.status.textContent = `Place ${this.points.length + 1}: on ${kFeatureNames[found.kind]}`;
    this.points.push(found.point);
    if (this.points.length >= kPointCount[this.kind]) this.finish();
    else this.show();
  }

  closeArea() {
    if (this.points.length > 2) this.finish();
  }

  finish() {
    const measured = { kind: this.kind, points: this.points };
    this.points = [];
    this.done.push(measured);
    const name = kKinds.find(([kind]) => kind === measured.kind)[1], value = valueOf(measured);
    const remove = element('button', { className: 'plain', aria: { label: `Remove ${name} ${value}` }, onclick: () => {
      this.done = this.done.filter((other) => other !== measured);
      measured.row.remove();
      this.show();
    } }, icon('close'));
    measured.row = element('li', {}, element('span', {}, name), element('b', {}, value), remove);
    this.list.append(measured.row);
    this.status.textContent = `${name}: ${value}`;
    this.show();
  }

  removeAll() {
    this.done = [];
    this.points = [];
    this.list.replaceChildren();
    this.status.textContent = '';
    this.show();
  }

  /** Keyboard measurements use the center of the view. */
  onKey(event) {
    if (event.key === 'Escape' && this.points.length > 0) {
      this.points = [];
      this.show();
      return true;
    }
    if (event.target !== this.scene.renderer.domElement) return false;
    if (event.key.startsWith('Arrow')) this.cross.hidden = false;
    if (event.key !== 'Enter') return false;
    this.cross.hidden = false;
    const { clientWidth: width, clientHeight: height } = this.scene.element;
    this.surface.prepare().then(() => this.take(width / 2, height / 2));
    return true;
  }

  show() {
    for (const old of this.group.children) {
      old.geometry.dispose();
      old.material.dispose();
    }
    this.group.clear();
    this.labels.replaceChildren();
    this.shown = [];
    const open = this.points.length > 0 ? [{ kind: this.kind, points: this.points, isOpen: true }] : [];
    for (const measured of [...this.done, ...open]) this.showOne(measured);
    this.close.hidden = this.kind !== 'area' || this.points.length < 3;
    this.clear.hidden = this.done.length === 0;
    this.scene.isStale = true;
  }

  showOne({ kind, points, isOpen }) {
    const outline = kind === 'area' && !isOpen ? [...points, points[0]] : [...points];
    // A height is a vertical line, with a level line to the lower point.
    if (kind === 'height' && points.length === 2) {
      const [high, low] = points[0].y > points[1].y ? points : [points[1], points[0]];
      outline.splice(0, 2, high, new THREE.Vector3(high.x, low.y, high.z), low);
    }
    const dots = new THREE.Points(new THREE.BufferGeometry().setFromPoints(points), this.dots);
    const line = new THREE.Line(new THREE.BufferGeometry().setFromPoints(outline), this.lines);
    for (const object of [line, dots]) {
      object.renderOrder = 10;
      object.frustumCulled = false;
    }
    this.group.add(line, dots);
    if (isOpen) return;
    const middle = kind === 'height' ? outline[0].clone().lerp(outline[1], 0.5)
                                     : points.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(points.length);
    const label = element('span', { className: 'label' }, valueOf({ kind, points }));
    this.labels.append(label);
    this.shown.push({ label, middle });
  }

  placeLabels() {
    for (const { label, middle } of this.shown ?? []) {
      const at = this.snap.onScreen(middle);
      label.hidden = !at;
      if (at) label.style.translate = `calc(${at[0]}px - 50%) calc(${at[1]}px - 120%)`;
    }
  }
}
