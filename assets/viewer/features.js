// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Edges and corners of objects. Voxels round them off by about the voxel size, so that no vertex of the mesh is on an
// edge: edges and corners are computed as intersections of the adjacent planes.
import * as THREE from 'three';

const kMinPlaneCosine = Math.cos(THREE.MathUtils.degToRad(14));     // between a triangle and its plane
const kMinExcludedCosine = Math.cos(THREE.MathUtils.degToRad(28));  // the same, for triangles excluded from other planes
const kMinEdgeSine = Math.sin(THREE.MathUtils.degToRad(25));        // minimum between two planes of an edge
const kMinCornerVolume = 0.3;                                       // minimum volume of the three unit normals of a corner
const kSeeds = 48, kRounds = 6;
// Refinement of a corner at its own position, in voxels.
const kRadius = 7;           // radius of the planes
const kRoundedWidth = 1.3;   // distance from the other planes, beyond the rounding
const kMinSupport = 5;       // minimum area per plane, square voxels
const kMaxDisplacement = 3;  // maximum displacement
const kConverged = 0.02, kIterations = 4;

function trianglesNear(surface, point, radius) {
  const found = [], u = new THREE.Vector3(), v = new THREE.Vector3();
  surface.near(point, radius, (a, b, c) => {
    const normal = new THREE.Vector3().crossVectors(u.subVectors(b, a), v.subVectors(c, a)), area = normal.length() / 2;
    if (area < 1e-12) return;
    // Limits the weight of a large triangle to its nearby part.
    found.push({ normal: normal.divideScalar(2 * area), area: Math.min(area, radius * radius / 2), a, b, c,
                 middle: new THREE.Vector3().add(a).add(b).add(c).divideScalar(3) });
  });
  return found;
}

/** Area-weighted fit of a plane to the triangles near `plane`. */
function fitPlane(triangles, plane, tolerance) {
  const normal = new THREE.Vector3();
  let offset = 0, area = 0;
  const members = triangles.filter((t) => t.normal.dot(plane.normal) > kMinPlaneCosine && Math.abs(plane.distanceToPoint(t.middle)) < tolerance);
  for (const t of members) {
    normal.addScaledVector(t.normal, t.area);
    area += t.area;
  }
  if (area === 0) return { plane, area };
  normal.normalize();
  for (const t of members) offset += t.area * normal.dot(t.middle);
  return { plane: new THREE.Plane(normal, -offset / area), area };
}

/** Up to four planes of the surface near a point, largest first. */
function planesNear(surface, point, radius, voxel) {
  let triangles = trianglesNear(surface, point, radius);
  const minArea = Math.max(0.06 * triangles.reduce((sum, { area }) => sum + area, 0), 4 * voxel * voxel), planes = [];
  while (planes.length < 4 && triangles.length > 0) {
    let best = { area: 0 };
    const step = Math.max(1, Math.floor(triangles.length / kSeeds));
    for (let i = 0; i < triangles.length; i += step) {
      const { normal, middle } = triangles[i];
      const found = fitPlane(triangles, new THREE.Plane().setFromNormalAndCoplanarPoint(normal, middle), 0.7 * voxel);
      if (found.area > best.area) best = found;
    }
    for (let i = 0; i < kRounds && best.area > 0; ++i) best = fitPlane(triangles, best.plane, 0.7 * voxel);
    if (best.area < minArea) break;
    planes.push(best.plane);
    triangles = triangles.filter((t) => t.normal.dot(best.plane.normal) < kMinExcludedCosine || Math.abs(best.plane.distanceToPoint(t.middle)) > 1.5 * voxel);
  }
  return planes;
}

function cornerOf(a, b, c) {
  const volume = a.normal.dot(new THREE.Vector3().crossVectors(b.normal, c.normal));
  if (Math.abs(volume) < kMinCornerVolume) return null;
  const sum = new THREE.Vector3();
  for (const [p, q, r] of [[a, b, c], [b, c, a], [c, a, b]])
    sum.addScaledVector(new THREE.Vector3().crossVectors(q.normal, r.normal), -p.constant);
  return sum.divideScalar(volume);
}

/** Nearest point to `point` on the intersection line of two planes. */
function edgeOf(a, b, point) {
  const along = new THREE.Vector3().crossVectors(a.normal, b.normal);
  if (along.length() < kMinEdgeSine) return null;
  return cornerOf(a, b, new THREE.Plane().setFromNormalAndCoplanarPoint(along.normalize(), point));
}

/**
 * Refines a corner of three planes with the surface around the corner instead of around the pointer. Returns null if a
 * plane is not visible outside the rounded area, as at the border of the observed surface.
 */
function refineCorner(surface, planes, begin, voxel) {
  let place = begin;
  for (let iteration = 0; iteration < kIterations; ++iteration) {
    const triangles = trianglesNear(surface, place, kRadius * voxel);
    const fits = planes.map((plane, i) => {
      const flat = triangles.filter(({ middle }) => planes.every((other, k) => k === i || Math.abs(other.distanceToPoint(middle)) > kRoundedWidth * voxel));
      return fitPlane(flat, plane, 0.7 * voxel);
    });
    if (fits.some(({ area }) => area < kMinSupport * voxel * voxel)) return null;
    planes = fits.map(({ plane }) => plane);
    const next = cornerOf(...planes);
    if (!next || next.distanceTo(begin) > kMaxDisplacement * voxel) return null;
    const moved = next.distanceTo(place);
    place = next;
    if (moved < kConverged * voxel) break;
  }
  return place;
}

/**
 * Corner or edge near a point on the surface: { point, kind }, or null. `isNearPointer(place, kind)` returns true if a
 * feature is near enough to the pointer; `voxel` in meters.
 */
export function featureNear(surface, point, radius, voxel, isNearPointer) {
  const planes = planesNear(surface, point, radius, voxel);
  const best = (kind, places) => {
    const candidates = places.filter((place) => place && place.distanceTo(point) < radius && isNearPointer(place, kind) &&
                                            surface.distance(place, 3 * voxel) < (kind === 'corner' ? 2.5 : 1.6) * voxel);
    candidates.sort((a, b) => a.distanceToSquared(point) - b.distanceToSquared(point));
    return candidates.length > 0 ? { point: candidates[0], kind } : null;
  };
  const corners = [], edges = [];
  planes.forEach((a, i) => planes.slice(i + 1).forEach((b, k) => {
    edges.push(edgeOf(a, b, point));
    for (const c of planes.slice(i + k + 2)) {
      const corner = cornerOf(a, b, c);
      if (corner && corner.distanceTo(point) < radius) corners.push(refineCorner(surface, [a, b, c], corner, voxel));
    }
  }));
  return best('corner', corners) ?? best('edge', edges);
}
