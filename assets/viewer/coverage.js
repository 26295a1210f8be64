// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Colors for the coverage of the surface, the fourth color byte of a live part.
import * as THREE from 'three';

/** From seen once to seen well, safe for red-green color blindness (RdYlBu of ColorBrewer). */
const kRamp = [[0.84, 0.19, 0.15], [0.99, 0.68, 0.38], [0.67, 0.85, 0.91], [0.17, 0.48, 0.71]];
export const kCoverageCss = `linear-gradient(90deg, ${kRamp.map((c) => `rgb(${c.map((v) => Math.round(255 * v)).join(' ')})`).join(', ')})`;

export function coverageMaterial(more = {}) {
  const material = new THREE.MeshLambertMaterial({ vertexColors: true, ...more });
  material.onBeforeCompile = (shader) => {
    const [a, b, c, d] = kRamp.map((stop) => `vec3(${stop.map((v) => v.toFixed(3)).join(', ')})`);
    shader.fragmentShader = shader.fragmentShader.replace('#include <color_fragment>', `
      float seen = 3.0 * vColor.a;
      vec3 covered = mix(mix(${a}, ${b}, min(seen, 1.0)), mix(${c}, ${d}, max(seen - 2.0, 0.0)), clamp(seen - 1.0, 0.0, 1.0));
      diffuseColor.rgb = sRGBTransferEOTF(vec4(covered, 1.0)).rgb;`);
  };
  return material;
}
