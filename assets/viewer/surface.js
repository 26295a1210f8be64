// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Geometric queries on the surface: ray casts and nearest triangles, answered by bounding volume hierarchies, built
// when the first tool needs them.
import * as THREE from 'three';
import { CENTER, MeshBVH } from 'three-mesh-bvh';

const kMaxBlocking = 30;  // milliseconds of work before yielding to the browser

const yieldToBrowser = () => new Promise((resolve) => setTimeout(resolve));

export class Surface {
  constructor(scene) {
    this.scene = scene;
    this.parts = [];  // BVH, mesh, and transforms in both directions
    this.raycaster = new THREE.Raycaster();
    if (scene.tiles) scene.tiles.onChange = () => { if (this.prepared) this.prepare(); };
  }

  /** Resolves when the trees of all visible meshes are built; later tiles follow. */
  prepare() {
    this.prepared = (this.prepared ?? Promise.resolve()).then(() => this.build());
    return this.prepared;
  }

  async build() {
    let since = performance.now();
    const shown = new Set(this.scene.meshes()), stay = this.parts.filter(({ mesh }) => shown.has(mesh));
    if (stay.length === shown.size) return;
    this.parts = stay;
    for (const { mesh } of stay) shown.delete(mesh);
    for (const mesh of shown) {
      if (performance.now() - since > kMaxBlocking) {
        await yieldToBrowser();
        since = performance.now();
      }
      mesh.updateWorldMatrix(true, false);
      const world = mesh.matrixWorld.clone();
      this.parts.push({ tree: new MeshBVH(mesh.geometry, { strategy: CENTER, indirect: true, targetLeafSize: 12 }), mesh, world,
                        local: world.clone().invert(), scale: world.getMaxScaleOnAxis() });
    }
    this.onChange?.();
  }

  /** Nearest visible intersection of a ray: { point, normal, distance }, or null. */
  cast(ray) {
    const planes = this.scene.clipping;
    let best = null;
    for (const { tree, world, local } of this.parts) {
      const inside = ray.clone().applyMatrix4(local);
      const hits = planes.length === 0 ? [tree.raycastFirst(inside, THREE.FrontSide)] : tree.raycast(inside, THREE.FrontSide);
      for (const hit of hits) {
        if (!hit) continue;
        const point = hit.point.clone().applyMatrix4(world), distance = point.distanceTo(ray.origin);
        if (best && best.distance <= distance) continue;
        if (planes.some((plane) => plane.distanceToPoint(point) < 0)) continue;
        best = { point, distance, normal: hit.face.normal.clone().transformDirection(world) };
      }
    }
    return best;
  }

  /** `x`, `y`: pixels in the view. */
  ray(x, y) {
    const { clientWidth: width, clientHeight: height } = this.scene.element;
    this.scene.camera.updateMatrixWorld();
    this.raycaster.setFromCamera(new THREE.Vector2(2 * x / width - 1, 1 - 2 * y / height), this.scene.camera);
    return this.raycaster.ray;
  }

  pick(x, y) { return this.cast(this.ray(x, y)); }

  /** The floor below a point, or null. */
  below(point) { return this.cast(new THREE.Ray(point, new THREE.Vector3(0, -1, 0))); }

  /** Calls `visit(a, b, c)` for each triangle that intersects a ball; reuses the vectors. */
  near(point, radius, visit) {
    for (const { tree, world, local, scale } of this.parts) {
      const sphere = new THREE.Sphere(point.clone().applyMatrix4(local), radius / scale);
      tree.shapecast({
        intersectsBounds: (box) => sphere.intersectsBox(box),
        intersectsTriangle: (triangle) => {
          if (!triangle.intersectsSphere(sphere)) return false;
          visit(triangle.a.clone().applyMatrix4(world), triangle.b.clone().applyMatrix4(world), triangle.c.clone().applyMatrix4(world));
          return false;
        },
      });
    }
  }

  /** Distance from a point to the surface in meters, at most `maxDistance`. */
  distance(point, maxDistance) {
    let best = maxDistance;
    for (const { tree, local, scale } of this.parts) {
      const hit = tree.closestPointToPoint(point.clone().applyMatrix4(local), {}, 0, best / scale);
      if (hit) best = Math.min(best, hit.distance * scale);
    }
    return best;
  }

  /** Intersection lines of a horizontal plane with the surface: flat list of x, y, z of both ends. */
  cut(height) {
    const plane = new THREE.Plane(new THREE.Vector3(0, 1, 0), -height), ends = [];
    const line = new THREE.Line3(), hit = new THREE.Vector3();
    for (const { tree, world, local } of this.parts) {
      const inside = plane.clone().applyMatrix4(local);
      tree.shapecast({
        intersectsBounds: (box) => inside.intersectsBox(box),
        intersectsTriangle: ({ a, b, c }) => {
          const found = [];
          for (const [from, to] of [[a, b], [b, c], [c, a]]) {
            if ((inside.distanceToPoint(from) < 0) === (inside.distanceToPoint(to) < 0)) continue;
            if (inside.intersectLine(line.set(from, to), hit)) found.push(hit.clone().applyMatrix4(world));
          }
          if (found.length === 2) for (const end of found) ends.push(end.x, end.y, end.z);
          return false;
        },
      });
    }
    return ends;
  }
}
