// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Floor plan: orthographic view from above, cut at a height, with the outlines of the walls at the cut.
import * as THREE from 'three';
import { element, slider } from './dom.js';
import { height } from './words.js';

const kCutHeight = 1.4;  // meters above the floor for the cut
const kMargin = 1.08;

export class Plan {
  constructor(scene, surface, level, turn) {
    Object.assign(this, { scene, surface, level, turn, isOn: false });
    this.outline = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ depthTest: false }));
    scene.tint(this.outline.material.color, 'outline');
    this.outline.frustumCulled = false;
    this.outline.visible = false;
    scene.scene.add(this.outline);
    surface.onChange = () => { if (this.isOn) this.cut(Number(this.slider.range.value)); };
    this.slider = slider({ label: 'Cut above the floor', min: 0.05, max: 3, value: kCutHeight, show: height, input: (value) => this.cut(value) });
    this.body = element('div', {}, element('p', { className: 'hint' }, 'Drag to move the plan, use the wheel to zoom. Measure works here, too.'), this.slider);
  }

  async start() {
    const { scene } = this, { box } = scene;
    if (box.isEmpty()) return;
    this.isOn = true;
    this.before = { eye: scene.perspective.position.clone(), target: scene.controls.target.clone() };
    const middle = box.getCenter(new THREE.Vector3());
    this.slider.range.max = Math.max(0.1, box.max.y - this.level + 0.05);
    this.slider.set(Math.min(kCutHeight, this.slider.range.max));
    // Aligns the walls with the edges of the view, and the longer sides of map and screen.
    let { turn } = this;
    const size = this.sizeTurned(turn), { clientWidth: width, clientHeight: height } = scene.element;
    if ((size.x > size.z) !== (width > height)) turn += Math.PI / 2;
    const seen = this.sizeTurned(turn), half = kMargin / 2 * Math.max(seen.z, seen.x * height / width);
    Object.assign(scene.orthographic, { top: half, bottom: -half, zoom: 1 });
    scene.orthographic.position.set(middle.x, box.max.y + 10, middle.z);
    scene.orthographic.up.set(-Math.sin(turn), 0, -Math.cos(turn));
    scene.setProjection(scene.orthographic);
    scene.controls.enableRotate = false;
    scene.controls.mouseButtons.LEFT = THREE.MOUSE.PAN;
    scene.controls.touches.ONE = THREE.TOUCH.PAN;
    scene.controls.target.set(middle.x, this.level, middle.z);
    scene.orthographic.lookAt(scene.controls.target);
    this.cut(Number(this.slider.range.value));
    await this.surface.prepare();
    if (this.isOn) this.cut(Number(this.slider.range.value));
  }

  /** Size of the map in rotated axes. */
  sizeTurned(turn) { return this.scene.boxTurned(turn).getSize(new THREE.Vector3()); }

  cut(above) {
    const height = this.level + above;
    this.scene.setClipping('plan', [new THREE.Plane(new THREE.Vector3(0, -1, 0), height)]);
    this.scene.setLine(this.outline, this.surface.cut(height));
    this.outline.visible = true;
  }

  end() {
    if (!this.isOn) return;
    this.isOn = false;
    const { scene } = this;
    this.outline.visible = false;
    scene.setClipping('plan', []);
    scene.controls.enableRotate = true;
    scene.controls.mouseButtons.LEFT = THREE.MOUSE.ROTATE;
    scene.controls.touches.ONE = THREE.TOUCH.ROTATE;
    scene.setProjection(scene.perspective);
    scene.place(this.before.eye, this.before.target);
  }
}
