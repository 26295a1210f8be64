// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Section box, aligned with the walls: only its inside is shown.
import * as THREE from 'three';
import { element, slider } from './dom.js';
import { height } from './words.js';

const kSides = [['Left', 'x', 0], ['Right', 'x', 1], ['Bottom', 'y', 0], ['Top', 'y', 1], ['Back', 'z', 0], ['Front', 'z', 1]];
const kSteps = 90;      // per quarter turn
const kSamples = 40000;

/** Direction of the walls: radians about the vertical, modulo a quarter turn, from the normals of vertical surfaces. */
export function wallsTurn(meshes) {
  const shares = new Float64Array(kSteps), a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
  for (const mesh of meshes) {
    const { index, attributes: { position } } = mesh.geometry;
    if (!index) continue;
    const step = 3 * Math.max(1, Math.floor(index.count / 3 / kSamples));
    for (let i = 0; i + 2 < index.count; i += step) {
      [a, b, c].forEach((v, k) => v.fromBufferAttribute(position, index.getX(i + k)).applyMatrix4(mesh.matrixWorld));
      b.sub(a).cross(c.sub(a));
      const area = b.length();
      if (area === 0 || Math.abs(b.y) > 0.2 * area) continue;
      const turn = (Math.atan2(b.x, b.z) / (Math.PI / 2) % 1 + 1) % 1;
      shares[Math.floor(turn * kSteps) % kSteps] += area;
    }
  }
  const around = (i) => shares[(i + kSteps - 1) % kSteps] + shares[i] + shares[(i + 1) % kSteps];
  let best = 0;
  for (let i = 1; i < kSteps; ++i) if (around(i) > around(best)) best = i;
  const left = shares[(best + kSteps - 1) % kSteps], right = shares[(best + 1) % kSteps];
  const turn = (best + 0.5 + (right - left) / (around(best) || 1)) / kSteps * Math.PI / 2;
  return turn > Math.PI / 4 ? turn - Math.PI / 2 : turn;
}

export class Section {
  constructor(scene, turn) {
    this.scene = scene;
    this.turn = turn;
    this.outline = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry()), new THREE.LineBasicMaterial());
    scene.tint(this.outline.material.color, 'mark');
    this.outline.visible = false;
    scene.scene.add(this.outline);
    this.sliders = element('div', {});
    this.body = element('div', {}, element('p', { className: 'hint' }, 'Only the inside of the box is shown and measured.'), this.sliders);
  }

  /** Bounds of the complete map, in axes aligned with the walls. */
  measureMap() {
    const box = this.scene.boxTurned(this.turn);
    this.bounds = box;
    this.inside = box.clone();
    this.sliders.replaceChildren(...kSides.map(([label, axis, end]) => {
      const [low, high] = [box.min[axis], box.max[axis]];
      return slider({ label, min: low, max: high, step: 0.01, value: end ? high : low, show: (v) => height(v - low),
                      input: (value) => this.set(axis, end, value) });
    }));
  }

  set(axis, end, value) {
    const { min, max } = this.inside;
    if (end) max[axis] = Math.max(value, min[axis] + 0.02);
    else min[axis] = Math.min(value, max[axis] - 0.02);
    this.cut();
  }

  cut() {
    const { min, max } = this.inside, planes = [];
    for (const axis of ['x', 'y', 'z']) {
      const along = new THREE.Vector3();
      along[axis] = 1;
      along.applyAxisAngle(new THREE.Vector3(0, 1, 0), this.turn);
      planes.push(new THREE.Plane(along, -min[axis] + 1e-3), new THREE.Plane(along.clone().negate(), max[axis] + 1e-3));
    }
    this.scene.setClipping('section', planes);
    const middle = this.inside.getCenter(new THREE.Vector3()).applyAxisAngle(new THREE.Vector3(0, 1, 0), this.turn);
    this.outline.position.copy(middle);
    this.outline.scale.copy(this.inside.getSize(new THREE.Vector3()));
    this.outline.rotation.y = this.turn;
    this.outline.updateMatrixWorld();
  }

  start() {
    this.measureMap();
    this.outline.visible = true;
    this.cut();
  }

  end() {
    this.outline.visible = false;
    this.scene.setClipping('section', []);
  }
}
