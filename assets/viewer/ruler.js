// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Scale bar, and a grid on the floor.
import * as THREE from 'three';
import { element } from './dom.js';
import { length } from './words.js';

const kMaxLength = 140;     // maximum length of the bar in pixels
const kGridHeight = 0.025;  // meters of the grid above the uneven floor

/** Largest of 1, 2 or 5 times a power of ten, at most `value`. */
function round(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return (value >= 5 * power ? 5 : value >= 2 * power ? 2 : 1) * power;
}

export class Ruler {
  constructor(scene, level, turn) {
    Object.assign(this, { scene, level, turn });
    this.words = element('span', {});
    this.bar = element('div', { id: 'scale', title: 'At the middle of the picture' }, this.words);
    scene.element.append(this.bar);
    scene.watchers.add(() => this.update());
    this.update();
  }

  get metersAPixel() {
    const { camera, controls, element: { clientHeight } } = this.scene;
    if (camera.isOrthographicCamera) return (camera.top - camera.bottom) / camera.zoom / clientHeight;
    return 2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2)) * camera.position.distanceTo(controls.target) / clientHeight;
  }

  update() {
    const pixel = this.metersAPixel, meters = round(kMaxLength * pixel);
    const words = length(meters);
    if (words !== this.words.textContent) this.words.textContent = words;
    this.bar.style.width = `${(meters / pixel).toFixed(1)}px`;
  }

  get hasGrid() { return Boolean(this.grid?.visible); }

  /** Toggles a grid of 1 m. */
  toggleGrid() {
    if (this.grid) this.grid.visible = !this.grid.visible;
    else this.grid = this.makeGrid();
    this.scene.isStale = true;
  }

  makeGrid() {
    const { box, scene } = this.scene, size = box.getSize(new THREE.Vector3()), middle = box.getCenter(new THREE.Vector3());
    const cells = Math.max(2, 2 * Math.ceil(Math.hypot(size.x, size.z) / 2)), grid = new THREE.GridHelper(cells, cells, 0xffffff, 0xffffff);
    this.scene.tint(grid.material.color, 'grid');
    grid.position.set(middle.x, this.level + kGridHeight, middle.z);
    grid.rotation.y = this.turn;
    scene.add(grid);
    return grid;
  }
}
