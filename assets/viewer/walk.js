// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Walking through the map: W A S D or the arrow keys, drag to look around; a stick on a phone.
import * as THREE from 'three';
import { element, slider } from './dom.js';
import { height } from './words.js';

const kSpeed = 1.3, kRun = 2.5;  // meters per second; factor with the shift key
const kLookRate = 0.004;         // radians per pixel
const kMaxStep = 0.5;            // maximum step height in meters
const kHeightRate = 6;           // rate per second at which the eye height follows the floor
const kStickRadius = 44;         // pixels
const kKeys = { KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1], KeyA: [-1, 0], ArrowLeft: [-1, 0], KeyD: [1, 0], ArrowRight: [1, 0] };

export class Walk {
  /** `level`: floor height used if no surface is below; `begin()` moves to the start of the camera path. */
  constructor(scene, surface, level, begin) {
    Object.assign(this, { scene, surface, level, begin, height: 1.6, pressed: new Set(), stick: [0, 0] });
    this.body = element('div', {}, element('p', { className: 'hint' }, 'W A S D or the arrow keys walk, dragging looks around, Shift is faster. On a phone use the round stick.'),
                        slider({ label: 'Eyes above the floor', min: 0.3, max: 2.2, step: 0.05, value: this.height, show: height,
                                 input: (value) => { this.height = value; } }));
    this.knob = element('div', { className: 'knob' });
    this.pad = element('div', { className: 'stick', hidden: true, aria: { hidden: 'true' } }, this.knob);
    scene.element.append(this.pad);
    this.pad.addEventListener('pointerdown', (event) => { this.pad.setPointerCapture(event.pointerId); this.push(event); });
    this.pad.addEventListener('pointermove', (event) => { if (this.pad.hasPointerCapture(event.pointerId)) this.push(event); });
    for (const end of ['pointerup', 'pointercancel']) this.pad.addEventListener(end, () => this.push(null));
    const canvas = scene.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => { if (this.isOn) this.dragged = [event.clientX, event.clientY]; });
    canvas.addEventListener('pointermove', (event) => this.onDrag(event));
    for (const end of ['pointerup', 'pointercancel', 'pointerleave']) canvas.addEventListener(end, () => { this.dragged = null; });
    addEventListener('keyup', (event) => {
      this.pressed.delete(event.code);
      this.isRunning = event.shiftKey;
    });
    addEventListener('blur', () => this.pressed.clear());
    this.move = (seconds) => this.step(seconds);
  }

  async start() {
    const { scene } = this, { camera } = scene;
    this.isOn = true;
    if (!scene.box.containsPoint(camera.position)) this.begin();
    const ahead = camera.getWorldDirection(new THREE.Vector3());
    this.turn = Math.atan2(-ahead.x, -ahead.z);
    this.tilt = Math.asin(THREE.MathUtils.clamp(ahead.y, -1, 1));
    scene.controls.enabled = false;
    scene.movers.add(this.move);
    this.pad.hidden = false;
    await this.surface.prepare();
  }

  end() {
    const { scene } = this;
    this.isOn = false;
    this.pressed.clear();
    this.push(null);
    this.pad.hidden = true;
    scene.movers.delete(this.move);
    scene.controls.enabled = true;
    scene.controls.target.copy(scene.camera.position).add(scene.camera.getWorldDirection(new THREE.Vector3()).multiplyScalar(1.5));
  }

  onKey(event) {
    if (!kKeys[event.code]) return false;
    this.pressed.add(event.code);
    this.isRunning = event.shiftKey;
    return true;
  }

  push(event) {
    let x = 0, y = 0;
    if (event) {
      const box = this.pad.getBoundingClientRect();
      x = (event.clientX - box.left - box.width / 2) / kStickRadius;
      y = (event.clientY - box.top - box.height / 2) / kStickRadius;
      const size = Math.max(1, Math.hypot(x, y));
      x /= size;
      y /= size;
    }
    this.stick = [x, -y];
    this.knob.style.translate = `${x * kStickRadius}px ${y * kStickRadius}px`;
  }

  onDrag(event) {
    if (!this.isOn || !this.dragged) return;
    this.turn += kLookRate * (event.clientX - this.dragged[0]);
    this.tilt = THREE.MathUtils.clamp(this.tilt + kLookRate * (event.clientY - this.dragged[1]), -1.5, 1.5);
    this.dragged = [event.clientX, event.clientY];
  }

  step(seconds) {
    const { camera } = this.scene;
    let [side, ahead] = this.stick;
    for (const code of this.pressed) {
      side += kKeys[code][0];
      ahead += kKeys[code][1];
    }
    const size = Math.max(1, Math.hypot(side, ahead)), distance = kSpeed * (this.isRunning ? kRun : 1) * seconds / size;
    const before = camera.position.clone();
    camera.position.x += distance * (side * Math.cos(this.turn) - ahead * Math.sin(this.turn));
    camera.position.z += distance * (-side * Math.sin(this.turn) - ahead * Math.cos(this.turn));
    const eyes = this.floor(camera.position) + this.height;
    camera.position.y += (eyes - camera.position.y) * Math.min(1, kHeightRate * seconds);
    const turned = new THREE.Quaternion().setFromEuler(new THREE.Euler(this.tilt, this.turn, 0, 'YXZ'));
    if (before.distanceTo(camera.position) < 1e-4 && camera.quaternion.angleTo(turned) < 1e-4) return;
    camera.quaternion.copy(turned);
    this.scene.isStale = true;
  }

  /** Height of the walkable surface; excludes tables. */
  floor(place) {
    const hit = this.surface.below(place);
    return hit && hit.normal.y > 0.7 && hit.point.y < this.level + kMaxStep ? hit.point.y : this.level;
  }
}
