// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The 3D view: surface, camera with its path, loop closures.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { behind } from './follow.js';
import { placeAt } from './path.js';
import { onTheme, themeColor } from './theme.js';

/** Linear intensity of an sRGB byte, scaled to 65535: three.js uses linear colors. */
const kLinear = Uint16Array.from({ length: 256 }, (_, c) => 65535 * new THREE.Color().setRGB(c / 255, 0, 0, THREE.SRGBColorSpace).r);

const kMaxDrawShare = 0.3;                        // maximum share of time for drawing while the user is idle
const kVerticalFov = 62, kMinHorizontalFov = 54;  // degrees: vertical field of view, and minimum horizontal
const kFollowTime = 0.5;                          // time constant in seconds for following the sensor
const kSamples = 20000;                           // maximum number of sampled vertices per mesh
const kUp = new THREE.Vector3(0, 1, 0);

/** The map's world has y down and z forward; three.js has y up. */
const kHalfTurn = new THREE.Quaternion(1, 0, 0, 0);
const kTurnShare = 0.2;  // share of the rotation per update
export const upright = ([x, y, z]) => new THREE.Vector3(x, -y, -z);

const radians = THREE.MathUtils.degToRad, degrees = THREE.MathUtils.radToDeg;

export class Scene {
  constructor(element) {
    this.element = element;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, powerPreference: 'high-performance' });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.localClippingEnabled = true;
    this.renderer.debug.checkShaderErrors = false;  // synchronous, slow
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', 'The map; arrow keys turn it');
    element.append(canvas);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color();
    this.perspective = new THREE.PerspectiveCamera(kVerticalFov, 1, 0.02, 500);
    this.orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.01, 500);
    this.camera = this.perspective;
    this.camera.position.set(0, 1.5, 3);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.isTurning = false;
    this.restUntil = 0;
    this.controls.addEventListener('start', () => { this.isTurning = true; this.setFollow(false); });
    this.controls.addEventListener('end', () => { this.isTurning = false; });
    canvas.addEventListener('keydown', (event) => this.turnByKey(event));
    const lamp = new THREE.DirectionalLight(0xffffff, 1.1);
    lamp.position.set(0.6, 0.5, 1);  // to the side, so that surfaces of different directions differ
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x555a62, 1.7), lamp);

    this.world = new THREE.Group();
    this.world.quaternion.copy(kHalfTurn);
    this.scene.add(this.world);
    this.surface = new THREE.Group();
    this.path = this.line('path');
    this.loops = this.line('loop', true);
    this.frustum = this.line('mark', true);
    this.world.add(this.surface, this.path, this.loops, this.frustum);
    this.submaps = new Map();
    this.parts = new Map();
    this.pathPoints = new Float32Array();
    this.loopTimes = [];
    this.clipping = [];  // planes; geometry behind a plane is not drawn
    this.cuts = new Map();
    // Materials are single-sided, so that a view from outside shows the inside of a room.
    this.materials = {
      color: new THREE.MeshBasicMaterial({ vertexColors: true, clippingPlanes: this.clipping }),
      shape: new THREE.MeshLambertMaterial({ clippingPlanes: this.clipping }),
      normal: new THREE.MeshBasicMaterial({ vertexColors: true, clippingPlanes: this.clipping }),
      tinted: new THREE.MeshLambertMaterial({ vertexColors: true, clippingPlanes: this.clipping }),
    };
    this.look = 'color';
    this.follow = false;
    this.movers = new Set();   // called with the seconds since the last frame, before each frame
    this.watchers = new Set();  // called after each frame
    this.tint(this.scene.background, 'ground');
    this.tint(this.materials.shape.color, 'shape');
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  /** Keeps a color at a variable of style.css. */
  tint(color, name) {
    onTheme(() => {
      color.set(themeColor(name));
      this.isStale = true;
    });
  }

  /** Starts drawing. Call it after loading, since drawing an empty view costs time. */
  begin() {
    this.renderer.setAnimationLoop(() => this.draw());
  }

  /** Line in a color of style.css. */
  line(name, segments = false) {
    const material = new THREE.LineBasicMaterial();
    this.tint(material.color, name);
    const line = segments ? new THREE.LineSegments(new THREE.BufferGeometry(), material)
                          : new THREE.Line(new THREE.BufferGeometry(), material);
    line.frustumCulled = false;
    return line;
  }

  setLine(line, places) {
    line.geometry.dispose();
    line.geometry = new THREE.BufferGeometry();
    line.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(places), 3));
    this.isStale = true;
  }

  resize() {
    const width = Math.max(this.element.clientWidth, 1), height = Math.max(this.element.clientHeight, 1);
    this.renderer.setSize(width, height);
    const aspect = width / height;
    // A portrait screen extends the vertical view instead of narrowing the horizontal view.
    this.perspective.aspect = aspect;
    this.perspective.fov = Math.min(100, Math.max(kVerticalFov, 2 * degrees(Math.atan(Math.tan(radians(kMinHorizontalFov / 2)) / aspect))));
    this.perspective.updateProjectionMatrix();
    const half = this.orthographic.top;
    Object.assign(this.orthographic, { left: -half * aspect, right: half * aspect });
    this.orthographic.updateProjectionMatrix();
    this.isStale = true;
    this.restUntil = 0;  // the canvas is empty
  }

  /** Draws only after changes, and less often without a fast GPU, to leave time for other work. */
  draw() {
    if (this.tiles?.update(this.camera, this.renderer)) this.isStale = true;
    const gl = this.renderer.getContext(), now = performance.now();
    if (this.fence) {
      if (gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return;
      gl.deleteSync(this.fence);
      this.fence = null;
      this.restUntil = now + (now - this.drawnAt) * (1 / kMaxDrawShare - 1);
    }
    if (now < this.restUntil && !this.isTurning && this.movers.size === 0) return;
    const elapsed = (now - (this.movedAt ?? now)) / 1000, seconds = Math.min(0.25, elapsed);
    this.movedAt = now;
    for (const move of this.movers) move(seconds);
    if (this.follow && this.eye) {
      const share = 1 - Math.exp(-elapsed / kFollowTime);
      this.camera.position.lerp(this.eye, share);
      this.controls.target.lerp(this.target, share);
      this.isStale = true;
    }
    const moved = this.controls.enabled && this.controls.update();
    const pose = this.camera.matrixWorld.elements.join();
    if (!moved && !this.isStale && pose === this.drawnFrom) return;
    this.render();
    this.drawnAt = now;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  render() {
    this.isStale = false;
    if (this.splats?.object.visible) this.splats.update(this.camera, this.renderer, this.clipping);
    this.renderer.render(this.scene, this.camera);
    this.drawnFrom = this.camera.matrixWorld.elements.join();
    for (const watch of this.watchers) watch();
  }

  /** Resolves after the next frame is drawn. */
  drawn() {
    this.isStale = true;
    return new Promise((resolve) => {
      const watch = () => {
        this.watchers.delete(watch);
        resolve();
      };
      this.watchers.add(watch);
    });
  }

  /** Resolves when the GPU has finished the next frame. */
  async shown() {
    await this.drawn();
    while (this.fence) await new Promise(requestAnimationFrame);
  }

  setFollow(follow) {
    this.follow = follow;
    this.onFollow?.(follow);
  }

  endFollowing() {
    this.setFollow(false);
    this.onFollow = null;
    this.eye = null;
    this.setLine(this.frustum, []);
    this.setLook('color');
  }

  setLook(look) {
    this.look = look;
    for (const mesh of this.meshes()) mesh.material = this.materialOf(mesh);
    this.isStale = true;
  }

  materialOf(mesh) {
    if (mesh.userData.textured?.map.image && this.look === 'color') {
      const { map } = mesh.userData.textured;
      map.needsUpdate = map.version === 0;  // just loaded
      return mesh.userData.textured;
    }
    const material = mesh.geometry.hasAttribute('color') ? this.materials[this.look] ?? this.materials.tinted : this.materials.shape;
    if (material !== this.materials.color && !mesh.geometry.hasAttribute('normal')) mesh.geometry.computeVertexNormals();
    return material;
  }

  *meshes() {
    yield* this.parts.values();
    if (this.tiles) yield* this.tiles.meshes();
    else if (this.model) {
      const found = [];
      this.model.traverse((node) => { if (node.isMesh) found.push(node); });
      yield* found;
    }
  }

  get triangles() {
    let triangles = 0;
    for (const mesh of this.meshes()) triangles += mesh.geometry.index ? mesh.geometry.index.count / 3 : 0;
    return triangles;
  }

  /** Removes the surface of a growing map. */
  dropParts() {
    for (const mesh of this.parts.values()) mesh.geometry.dispose();
    this.parts.clear();
    this.surface.clear();
    this.submaps.clear();
  }

  clear() {
    this.dropParts();
    this.setPath(new Float32Array());
    this.setLoops([]);
    this.isStale = true;
  }

  submap(number) {
    let group = this.submaps.get(number);
    if (!group) {
      group = new THREE.Group();
      group.matrixAutoUpdate = false;
      this.submaps.set(number, group);
      this.surface.add(group);
    }
    return group;
  }

  setSubmaps(poses) {
    poses.forEach((pose, number) => {
      const group = this.submap(number);
      group.matrix.fromArray(pose);
      group.matrixWorldNeedsUpdate = true;
    });
    this.isStale = true;
  }

  setPart(part) {
    const name = `${part.submap} ${part.cell}`;
    const old = this.parts.get(name);
    if (old) {
      old.geometry.dispose();
      old.removeFromParent();
      this.parts.delete(name);
    }
    if (part.indices.length === 0) return;
    const geometry = new THREE.BufferGeometry();
    const positions = new THREE.InterleavedBuffer(part.positions, 4);
    geometry.setAttribute('position', new THREE.InterleavedBufferAttribute(positions, 3, 0, true));
    geometry.setAttribute('color', new THREE.BufferAttribute(Uint16Array.from(part.colors, (c, i) => i % 4 === 3 ? 257 * c : kLinear[c]), 4, true));
    const normals = new THREE.InterleavedBuffer(part.normals, 4);
    geometry.setAttribute('normal', new THREE.InterleavedBufferAttribute(normals, 3, 0, true));
    geometry.setIndex(new THREE.BufferAttribute(part.indices, 1));
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0.5, 0.5, 0.5), 0.87);
    const mesh = new THREE.Mesh(geometry);
    mesh.material = this.materialOf(mesh);
    mesh.position.fromArray(part.origin);
    mesh.scale.setScalar(part.size);
    this.parts.set(name, mesh);
    this.submap(part.submap).add(mesh);
    this.isStale = true;
  }

  /** `points`: flat list of t, x, y, z. */
  setPath(points) {
    this.pathPoints = points;
    const places = [];
    for (let i = 0; i < points.length; i += 4) places.push(points[i + 1], points[i + 2], points[i + 3]);
    this.setLine(this.path, places);
    this.setLoops(this.loopTimes);
  }

  /** `times`: [from, to] in the path's time. */
  setLoops(times) {
    this.loopTimes = times;
    const places = this.pathPoints.length > 0
        ? times.flatMap(([from, to]) => [...placeAt(this.pathPoints, from), ...placeAt(this.pathPoints, to)]) : [];
    this.setLine(this.loops, places);
  }

  /** Rotates a growing map by the gravity alignment [x, y, z, w], smoothly by a share per update. */
  setUpright(turn, share = kTurnShare) {
    this.world.quaternion.slerp(kHalfTurn.clone().multiply(new THREE.Quaternion(...turn)), share);
    this.isStale = true;
  }

  /** Draws the sensor's frustum: `pose` in column-major order, `fx` in image widths. */
  setCamera(pose, view) {
    const depth = 0.12, x = depth * 0.5 / view.fx, y = x / view.aspect;
    const corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(([a, b]) => [a, b, depth]);
    const places = corners.flatMap((corner, i) => [0, 0, 0, ...corner, ...corner, ...corners[(i + 1) % 4]]);
    this.setLine(this.frustum, places);
    this.frustum.matrixAutoUpdate = false;
    this.frustum.matrix.fromArray(pose);
    this.frustum.matrixWorldNeedsUpdate = true;
    this.world.updateMatrixWorld(true);
    const inWorld = (a) => new THREE.Vector3(...a).applyMatrix4(this.frustum.matrix).applyMatrix4(this.world.matrixWorld);
    const { eye, target } = behind(view, radians(this.perspective.fov), this.perspective.aspect);
    const isFirst = !this.eye;
    this.eye = inWorld(eye);
    this.target = inWorld(target);
    if (isFirst && this.follow) this.place(this.eye, this.target);
    this.isStale = true;
  }

  /** Shows a glTF model with the page's materials: unlit, sharp, visible from inside. */
  setModel(model) {
    this.dropParts();
    for (const { geometry } of this.meshes()) geometry.dispose();
    this.model?.removeFromParent();
    this.model = model;
    this.restUntil = 0;  // draw immediately
    this.scene.add(model);
    model.updateMatrixWorld(true);
    for (const mesh of this.meshes()) this.adopt(mesh);
    this.isStale = true;
  }

  /** Shows tiles instead of a model. */
  setTiles(tiles) {
    this.tiles = tiles;
    this.model = tiles.group;
    this.scene.add(this.model);
    this.perspective.far = Math.max(this.perspective.far, 4 * this.box.getSize(new THREE.Vector3()).length());
    this.resize();
  }

  /** Adds splats in place of the surface. */
  setSplats(splats) {
    this.splats = splats;
    this.scene.add(splats.object);
    this.showSplats(true);
  }

  /** Shows the splats or the surface. Tools keep using the surface. */
  showSplats(isShown) {
    this.splats.object.visible = isShown;
    if (this.model) this.model.visible = !isShown;
    this.restUntil = 0;
    this.isStale = true;
  }

  /** Assigns the page's materials to a loaded mesh. */
  adopt(mesh) {
    const { map } = mesh.material;
    if (map) {
      map.anisotropy = this.isSoftware ? 1 : Math.min(8, this.renderer.capabilities.getMaxAnisotropy());
      mesh.userData.textured = new THREE.MeshBasicMaterial({ map, clippingPlanes: this.clipping });
    }
    mesh.material = this.materialOf(mesh);
  }

  /** True for a software renderer, where cheap GPU features take seconds. */
  get isSoftware() {
    const gl = this.renderer.getContext(), names = gl.getExtension('WEBGL_debug_renderer_info');
    return /swiftshader|llvmpipe|software/i.test(names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : '');
  }

  /** Bounds of the model; empty without a model. */
  get box() {
    if (this.tiles) return this.tiles.box;
    return this.model ? new THREE.Box3().setFromObject(this.model) : new THREE.Box3();
  }

  /** Clips the surface by `planes` in the three.js world, combined with the planes of other callers. */
  setClipping(who, planes) {
    this.cuts.set(who, planes);
    this.clipping.splice(0, this.clipping.length, ...[...this.cuts.values()].flat());
    this.isStale = true;
  }

  setProjection(camera) {
    this.camera = camera;
    this.controls.object = camera;
    this.resize();
  }

  place(eye, target) {
    this.controls.target.copy(target);
    this.camera.position.copy(eye);
    this.camera.up.copy(kUp);
    this.camera.lookAt(target);
    this.isStale = true;
  }

  /** Looks from a camera pose, t x y z qx qy qz qw, with the horizon level. */
  lookFrom([, x, y, z, ...q]) {
    const eye = upright([x, y, z]), forward = upright(new THREE.Vector3(0, 0, 1).applyQuaternion(new THREE.Quaternion(...q)).toArray());
    const middle = this.box.isEmpty() ? eye : this.box.getCenter(new THREE.Vector3());
    const reach = THREE.MathUtils.clamp(middle.sub(eye).dot(forward), 1, 3);
    this.place(eye, eye.clone().addScaledVector(forward, reach));
  }

  lookAtAll() {
    const box = this.model ? this.box : this.splats?.box ?? new THREE.Box3().setFromObject(this.world);
    if (box.isEmpty()) return;
    const middle = box.getCenter(new THREE.Vector3()), away = new THREE.Vector3(0.35, 0.8, 1).normalize();
    this.place(middle.clone().add(away), middle);
    this.camera.updateMatrixWorld();
    // Centered, at the smallest distance with the complete model in view: the four side planes of the frustum touch it.
    const t = Math.tan(radians(this.perspective.fov / 2)), slopes = [t * this.perspective.aspect, t];
    const max = [[-Infinity, -Infinity], [-Infinity, -Infinity]], inverse = this.camera.matrixWorld.clone().invert();
    for (const place of this.tiles ? this.cornersOf(box) : this.placesOf(box)) {
      const { x, y, z } = place.applyMatrix4(inverse);
      [x, y].forEach((v, i) => [v, -v].forEach((side, k) => { max[i][k] = Math.max(max[i][k], side + slopes[i] * z); }));
    }
    const [right, up] = max.map(([a, b]) => (a - b) / 2), back = Math.max(...max.map(([a, b], i) => (a + b) / (2 * slopes[i])));
    const eye = new THREE.Vector3(right, up, back).applyMatrix4(this.camera.matrixWorld), reach = away.dot(eye.clone().sub(middle));
    this.place(eye.clone().addScaledVector(away, 0.04 * reach), eye.clone().addScaledVector(away, -reach));
  }

  /** Yields the corners of a box; reuses the vector. */
  *cornersOf({ min, max }) {
    const place = new THREE.Vector3();
    for (let i = 0; i < 8; ++i) yield place.set(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
  }

  /** Yields sampled vertices of the model, or the corners of the box without a model; reuses the vector. */
  *placesOf(box) {
    const place = new THREE.Vector3();
    if (!this.model) yield* this.cornersOf(box);
    else for (const mesh of this.meshes()) {
      const { position } = mesh.geometry.attributes, step = Math.max(1, Math.floor(position.count / kSamples));
      for (let i = 0; i < position.count; i += step) yield place.fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld);
    }
  }

  /** Bounds of the map in axes rotated with its walls. */
  boxTurned(turn) {
    const turned = new THREE.Matrix4().makeRotationY(-turn), box = new THREE.Box3(), place = new THREE.Vector3();
    if (this.tiles) for (const corner of this.cornersOf(this.box)) box.expandByPoint(corner.applyMatrix4(turned));
    else for (const mesh of this.meshes()) {
      const { position } = mesh.geometry.attributes, all = turned.clone().multiply(mesh.matrixWorld);
      for (let i = 0; i < position.count; i += 3) box.expandByPoint(place.fromBufferAttribute(position, i).applyMatrix4(all));
    }
    return box;
  }

  turnByKey(event) {
    const turns = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const turn = turns[event.key];
    if (!turn || !this.controls.enabled || event.defaultPrevented) return;
    event.preventDefault();
    this.setFollow(false);
    const kStep = 0.08;
    const offset = this.camera.position.clone().sub(this.controls.target), about = new THREE.Spherical().setFromVector3(offset);
    about.theta += kStep * turn[0];
    about.phi -= kStep * turn[1];
    this.camera.position.copy(this.controls.target).add(offset.setFromSpherical(about.makeSafe()));
    this.isStale = true;
  }
}
