// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The 3D picture: surface, camera and its path, loops.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const kPathColour = 0x4c8dff, kLoopColour = 0x37b26c, kCameraColour = 0xffc531;

/** Light that an sRGB byte stands for, of 65535: three.js reckons in light. */
const kLinear = Uint16Array.from({ length: 256 }, (_, c) => 65535 * new THREE.Color().setRGB(c / 255, 0, 0, THREE.SRGBColorSpace).r);

const kShare = 0.3;  // of the time that drawing may take while nobody turns the picture

/** The place on a polyline of [t, x, y, z] at a time. */
function placeAt(points, time) {
  let low = 0, high = points.length / 4 - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[4 * middle] < time) low = middle + 1;
    else high = middle;
  }
  return [points[4 * low + 1], points[4 * low + 2], points[4 * low + 3]];
}

export class Scene {
  constructor(element) {
    this.element = element;
    this.renderer = new THREE.WebGLRenderer({ antialias: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    element.append(this.renderer.domElement);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x14171b);
    this.camera = new THREE.PerspectiveCamera(60, 1, 0.02, 500);
    this.camera.position.set(0, 1.5, 3);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.isTurning = false;
    this.restUntil = 0;
    this.controls.addEventListener('start', () => { this.isTurning = true; this.setFollow(false); });
    this.controls.addEventListener('end', () => { this.isTurning = false; });
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x777777, 2.4), new THREE.DirectionalLight(0xffffff, 0.8));

    // The map's world has y down and z forward; three.js has y up.
    this.world = new THREE.Group();
    this.world.rotation.x = Math.PI;
    this.scene.add(this.world);
    this.surface = new THREE.Group();
    this.path = this.line(kPathColour);
    this.loops = this.line(kLoopColour, true);
    this.frustum = this.line(kCameraColour, true);
    this.world.add(this.surface, this.path, this.loops, this.frustum);
    this.submaps = new Map();
    this.parts = new Map();
    this.pathPoints = new Float32Array();
    this.loopTimes = [];
    this.materials = {
      colour: new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide }),
      shape: new THREE.MeshLambertMaterial({ color: 0xc9ced6, side: THREE.DoubleSide }),
    };
    this.look = 'colour';
    this.follow = false;
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
    this.renderer.setAnimationLoop(() => this.draw());
  }

  line(color, segments = false) {
    const material = new THREE.LineBasicMaterial({ color });
    const line = segments ? new THREE.LineSegments(new THREE.BufferGeometry(), material)
                          : new THREE.Line(new THREE.BufferGeometry(), material);
    line.frustumCulled = false;
    return line;
  }

  setLine(line, places) {
    line.geometry.dispose();
    line.geometry = new THREE.BufferGeometry();
    line.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(places), 3));
  }

  resize() {
    const width = Math.max(this.element.clientWidth, 1), height = Math.max(this.element.clientHeight, 1);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    // The panel covers a part of the canvas: the middle of what can be seen is the middle of the picture.
    const panel = document.getElementById('panel').getBoundingClientRect();
    const covered = panel.height >= innerHeight - 1 ? Math.min(panel.width, width - 1) : 0;
    if (covered > 0) this.camera.setViewOffset(width, height, covered / 2, 0, width, height);
    else this.camera.clearViewOffset();
    this.camera.updateProjectionMatrix();
    this.isStale = true;
  }

  /** Draws only when something moved, and without a fast GPU not as often as it could: others need the time, too. */
  draw() {
    const gl = this.renderer.getContext(), now = performance.now();
    if (this.fence) {
      if (gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return;
      gl.deleteSync(this.fence);
      this.fence = null;
      this.restUntil = now + (now - this.drawnAt) * (1 / kShare - 1);
    }
    if (now < this.restUntil && !this.isTurning) return;
    if (this.follow && this.eye) {
      this.camera.position.lerp(this.eye, 0.1);
      this.controls.target.lerp(this.target, 0.1);
      this.isStale = true;
    }
    const moved = this.controls.update();
    const pose = this.camera.matrixWorld.elements.join();
    if (!moved && !this.isStale && pose === this.drawnFrom) return;
    this.isStale = false;
    this.drawnFrom = pose;
    this.drawnAt = now;
    this.renderer.render(this.scene, this.camera);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  setFollow(follow) {
    this.follow = follow;
    this.onFollow?.(follow);
  }

  setLook(look) {
    this.look = look;
    for (const mesh of this.meshes()) mesh.material = this.materialOf(mesh);
    this.isStale = true;
  }

  materialOf(mesh) {
    if (mesh.userData.textured) return this.look === 'colour' ? mesh.userData.textured : this.materials.shape;
    return mesh.geometry.hasAttribute('color') ? this.materials[this.look] : this.materials.shape;
  }

  *meshes() {
    yield* this.parts.values();
    if (this.model) {
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

  clear() {
    for (const mesh of this.parts.values()) mesh.geometry.dispose();
    this.parts.clear();
    this.surface.clear();
    this.submaps.clear();
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
    geometry.setAttribute('color', new THREE.BufferAttribute(Uint16Array.from(part.colours, (c) => kLinear[c]), 4, true));
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

  /** `points`: t, x, y, z one after the other. */
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
    this.isStale = true;
  }

  /** A camera where the sensor is: `pose` column by column, `fx` in image widths. */
  setCamera(pose, view) {
    const depth = 0.25, x = depth * 0.5 / view.fx, y = x / view.aspect;
    const corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(([a, b]) => [a, b, depth]);
    const places = corners.flatMap((corner, i) => [0, 0, 0, ...corner, ...corner, ...corners[(i + 1) % 4]]);
    this.setLine(this.frustum, places);
    this.frustum.matrixAutoUpdate = false;
    this.frustum.matrix.fromArray(pose);
    this.frustum.matrixWorldNeedsUpdate = true;
    this.world.updateMatrixWorld(true);
    const inWorld = (a) => new THREE.Vector3(...a).applyMatrix4(this.frustum.matrix).applyMatrix4(this.world.matrixWorld);
    this.eye = inWorld([0, -0.6, -1.4]);
    this.target = inWorld([0, 0, 1.5]);
    this.isStale = true;
  }

  /** A finished mesh, glTF: y is up in it. */
  async setModel(bytes) {
    const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(bytes, '');
    this.model = gltf.scene;
    this.scene.add(this.model);
    for (const mesh of this.meshes()) {
      if (mesh.material.map) mesh.userData.textured = mesh.material;
      mesh.material = this.materialOf(mesh);
    }
    this.lookAtAll();
  }

  lookAtAll() {
    const box = new THREE.Box3();
    if (this.model) box.setFromObject(this.model);
    else box.setFromObject(this.world);
    if (box.isEmpty()) return;
    const middle = box.getCenter(new THREE.Vector3()), radius = box.getSize(new THREE.Vector3()).length() / 2;
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new THREE.Vector3(0.25, 0.65, 1).normalize().multiplyScalar(1.5 * radius));
    this.isStale = true;
  }
}
