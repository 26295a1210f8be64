// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Playback of the camera path, with keyframe pictures and stretches without poses.
import * as THREE from 'three';
import { checkbox, element, slider } from './dom.js';
import { icon } from './icons.js';
import { lostStretches, nearest, poseAt } from './path.js';
import { upright } from './scene.js';
import { seconds as said } from './words.js';

const kClickTolerance = 14;  // click tolerance in pixels
const kFx = 0.91;            // image widths: about 58 degrees, typical of depth cameras

export class Playback {
  /** `data`: trajectory, keyframes and the report of the map. */
  constructor(scene, data) {
    this.scene = scene;
    this.trajectory = data.trajectory;
    this.begin = this.trajectory[0][0];
    this.length = this.trajectory.at(-1)[0] - this.begin;
    this.keyframes = (data.keyframes ?? []).filter(({ time }) => Number.isFinite(time));
    this.keyframeTimes = this.keyframes.map(({ time }) => time);
    this.lost = lostStretches(this.trajectory, data.report.per_frame ?? []);
    this.time = 0;
    this.speed = 1;
    this.rides = false;
    this.marks = this.addMarks();
    this.play = element('button', { className: 'play', onclick: () => this.setPlaying(!this.isPlaying) });
    this.slider = slider({ label: 'Time', min: 0, max: this.length, step: 0.01, value: 0, show: said, input: (time) => { this.setPlaying(false); this.go(time); } });
    this.picture = element('img', { alt: 'What the camera saw here', hidden: this.keyframes.length === 0, className: 'keyframe' });
    this.status = element('p', { className: 'status', aria: { live: 'polite' } });
    this.rideBox = checkbox('Look through the camera', false, (on) => this.ride(on));
    const speed = element('select', { aria: { label: 'Speed' }, onchange: () => { this.speed = Number(speed.value); } },
                          ...[0.5, 1, 2, 4].map((times) => element('option', { value: times, selected: times === 1 }, `${times}×`)));
    const words = [`${this.keyframes.length} keyframes`, `${data.report.loops?.length ?? 0} loops`,
                   this.lost.length === 1 ? '1 stretch without poses' : `${this.lost.length} stretches without poses`];
    this.body = element('div', { className: 'playback' }, this.picture,
                        element('div', {}, this.slider, element('div', { className: 'row' }, this.play, speed, this.rideBox), this.status,
                                this.legend(words), element('p', { className: 'hint' }, 'Click the path or a keyframe to go there.')));
    const canvas = scene.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => { this.pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener('pointerup', (event) => this.onClick(event));
    this.move = (seconds) => this.step(seconds);
    this.setPlaying(false);
  }

  legend([keyframes, loops, lost]) {
    const entry = (kind, words) => element('li', { className: kind }, words);
    return element('ul', { className: 'marks' }, ...(this.keyframes.length ? [entry('is-keyframe', keyframes)] : []), entry('is-loop', loops), entry('is-lost', lost));
  }

  /** Dots at keyframes, red lines over stretches without poses. */
  addMarks() {
    const group = new THREE.Group(), placesAt = (times) => times.map((time) => poseAt(this.trajectory, time).place);
    const dots = (places, color, size) => {
      const points = new THREE.Points(new THREE.BufferGeometry().setFromPoints(places),
                                      new THREE.PointsMaterial({ size: size * this.scene.renderer.getPixelRatio(), sizeAttenuation: false }));
      this.scene.tint(points.material.color, color);
      points.frustumCulled = false;
      group.add(points);
    };
    dots(placesAt(this.keyframeTimes), 'mark', 6);
    const ends = placesAt(this.lost.flat());
    dots(ends, 'lost-mark', 8);
    const lines = this.scene.line('lost-mark', true);
    lines.geometry.setFromPoints(ends);
    group.add(lines);
    this.scene.world.add(group);
    return group;
  }

  start() {
    this.isOn = true;
    this.scene.frustum.visible = true;
    this.go(this.time);
  }

  end() {
    this.isOn = false;
    this.setPlaying(false);
    this.ride(false);
    this.scene.frustum.visible = false;
    this.scene.isStale = true;
  }

  setPlaying(playing) {
    this.isPlaying = playing;
    this.play.replaceChildren(icon(playing ? 'pause' : 'play'));
    this.play.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    if (playing) {
      if (this.time >= this.length) this.time = 0;
      this.scene.movers.add(this.move);
    } else {
      this.scene.movers.delete(this.move);
    }
  }

  step(seconds) {
    this.go(Math.min(this.time + this.speed * seconds, this.length));
    if (this.time >= this.length) this.setPlaying(false);
  }

  ride(on) {
    this.rides = on;
    this.rideBox.querySelector('input').checked = on;
    this.scene.controls.enabled = !on;
    if (on) this.go(this.time);
  }

  /** `time`: seconds from the start. */
  go(time) {
    this.time = time;
    this.slider.set(time);
    const { place, turn, matrix } = poseAt(this.trajectory, this.begin + time);
    this.scene.setCamera(matrix.elements, { fx: kFx, aspect: 4 / 3 });
    this.scene.frustum.visible = !this.rides;
    if (this.rides) {
      const eye = upright(place.toArray()), ahead = upright(new THREE.Vector3(0, 0, 1).applyQuaternion(turn).toArray());
      this.scene.place(eye, eye.clone().addScaledVector(ahead, 1.5));
    }
    this.updateStatus();
  }

  updateStatus() {
    const at = this.begin + this.time, isLost = this.lost.some(([from, to]) => at > from && at < to);
    let words = isLost ? 'The camera was lost here.' : '';
    if (this.keyframes.length > 0) {
      const i = nearest(this.keyframeTimes, at);
      words = `Keyframe ${i + 1} of ${this.keyframes.length}. ${words}`;
      const { picture } = this.keyframes[i];
      this.picture.hidden = !picture;
      if (picture && this.picture.getAttribute('src') !== picture) this.picture.src = picture;
    }
    this.status.textContent = words;
  }

  onKey(event) {
    const isOurs = event.target === this.scene.renderer.domElement || event.target === document.body;
    if (event.key === ' ' && isOurs) this.setPlaying(!this.isPlaying);
    else if (event.key === ',' || event.key === '.') this.toKeyframe(event.key === '.' ? 1 : -1);
    else return false;
    return true;
  }

  toKeyframe(step) {
    this.setPlaying(false);
    if (this.keyframes.length === 0) return this.go(THREE.MathUtils.clamp(this.time + step, 0, this.length));
    const i = nearest(this.keyframeTimes, this.begin + this.time) + step;
    this.go(this.keyframeTimes[THREE.MathUtils.clamp(i, 0, this.keyframes.length - 1)] - this.begin);
  }

  /** Time of the keyframe, or else of the pose, at a pixel; null if none is near. */
  timeAt(x, y) {
    const { clientWidth: width, clientHeight: height } = this.scene.element, at = new THREE.Vector3();
    const bestOf = (times) => {
      let best = null, minDistance = kClickTolerance;
      for (const time of times) {
        at.copy(upright(poseAt(this.trajectory, time).place.toArray())).project(this.scene.camera);
        const off = at.z < 1 ? Math.hypot((at.x + 1) * width / 2 - x, (1 - at.y) * height / 2 - y) : Infinity;
        if (off < minDistance) [best, minDistance] = [time, off];
      }
      return best;
    };
    return bestOf(this.keyframeTimes) ?? bestOf(this.trajectory.map(([t]) => t));
  }

  onClick(event) {
    const { pressed } = this;
    this.pressed = null;
    if (!pressed || this.rides || this.isBlocked?.() || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 6) return;
    const box = this.scene.element.getBoundingClientRect(), time = this.timeAt(event.clientX - box.left, event.clientY - box.top);
    if (time == null) return;
    this.onOpen?.();
    this.setPlaying(false);
    this.go(Math.max(0, time - this.begin));
  }
}
