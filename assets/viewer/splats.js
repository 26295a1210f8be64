// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gaussian splats of a .spz file (Niantic, versions 2 and 3), drawn as quads from back to front: EWA splatting (Zwicker
// et al. 2001), colors with spherical harmonics up to degree 3.
import * as THREE from 'three';

const kMagic = 0x5053474e, kHeader = 16;
const kBytes = { position: 9, opacity: 1, color: 3, scale: 3 };
const kColorScale = 0.15, kHarmonic0 = 0.28209479177387814;
const kTexelsByDegree = [4, 4, 6, 7], kSplatsPerRow = 256, kFirstHarmonic = 13;  // word of a splat
const kSortBits = 16;
const kOutliers = 0.02;  // share of the splats outside of the bounds, at each end of an axis
const kMinTurn = 0.02, kMinShift = 0.02;  // radians, meters: camera motion before the splats are sorted again

async function unpacked(buffer) {
  const stream = new Blob([buffer]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Quaternion [x, y, z, w] from its smallest three components. */
function unpackRotation(packed) {
  const largest = packed >>> 30, q = [0, 0, 0, 0];
  let squared = 0;
  for (let k = 3; k >= 0; --k) {
    if (k === largest) continue;
    q[k] = (packed & 511) / 511 * Math.SQRT1_2 * (packed & 512 ? -1 : 1);
    squared += q[k] * q[k];
    packed >>>= 10;
  }
  q[largest] = Math.sqrt(Math.max(0, 1 - squared));
  return q;
}

function unpackFirstThree(bytes, at) {
  const [x, y, z] = [0, 1, 2].map((k) => bytes[at + k] / 127.5 - 1);
  return [x, y, z, Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z))];
}

/** Indices of the `max` splats with the largest product of opacity and area, in the file's order. */
function mostImportant(bytes, count, max, opacities, scales) {
  const importance = Float32Array.from({ length: count }, (_, i) => {
    const [a, b, c] = [0, 1, 2].map((k) => bytes[scales + 3 * i + k]);
    return bytes[opacities + i] * Math.exp((a + b + c - Math.min(a, b, c)) / 16);
  });
  const least = Float32Array.from(importance).sort()[count - max];
  let equal = max - importance.reduce((larger, value) => larger + (value > least), 0);
  return Uint32Array.from({ length: count }, (_, i) => i).filter((i) => importance[i] > least || (importance[i] === least && equal-- > 0));
}

/**
 * Splats of a .spz file, at most `max`: positions (x, y, z; y up), and the words of the texture: position and opacity;
 * color; the covariance, row by row from the diagonal; bytes of the harmonics of degree 1 and above.
 */
export async function readSpz(buffer, max = Infinity) {
  const bytes = await unpacked(buffer), view = new DataView(bytes.buffer);
  if (bytes.length < kHeader || view.getUint32(0, true) !== kMagic) throw new Error('these are not splats');
  const version = view.getUint32(4, true), all = view.getUint32(8, true), degree = bytes[12], scale = 2 ** -bytes[13];
  if (version !== 2 && version !== 3) throw new Error(`splats of version ${version} are not supported`);
  if (degree > 3) throw new Error(`harmonics of degree ${degree} are not supported`);
  const perRotation = version === 2 ? 3 : 4, perSplat = (degree + 1) ** 2 - 1;
  const opacities = kHeader + kBytes.position * all, colors = opacities + kBytes.opacity * all;
  const scales = colors + kBytes.color * all, rotations = scales + kBytes.scale * all, harmonics = rotations + perRotation * all;
  if (bytes.length < harmonics + 3 * perSplat * all) throw new Error('the splats are cut off');
  const kept = all > max ? mostImportant(bytes, all, max, opacities, scales) : null, count = kept ? kept.length : all;
  const texels = kTexelsByDegree[degree], positions = new Float32Array(3 * count), height = Math.max(1, Math.ceil(count / kSplatsPerRow));
  const words = new Uint32Array(4 * texels * kSplatsPerRow * height), floats = new Float32Array(words.buffer);
  const turn = new THREE.Matrix3(), m = new THREE.Matrix4(), q = new THREE.Quaternion();
  for (let to = 0; to < count; ++to) {
    const i = kept ? kept[to] : to, at = 4 * texels * to;
    for (let k = 0; k < 3; ++k) {
      const b = kHeader + kBytes.position * i + 3 * k;
      positions[3 * to + k] = floats[at + k] = scale * ((bytes[b] | bytes[b + 1] << 8 | bytes[b + 2] << 16) << 8 >> 8);
    }
    for (let k = 0; k < 3; ++k) floats[at + 4 + k] = 0.5 + kHarmonic0 * (bytes[colors + 3 * i + k] / 255 - 0.5) / kColorScale;
    floats[at + 3] = bytes[opacities + i] / 255;
    const rotation = rotations + perRotation * i;
    q.set(...(version === 2 ? unpackFirstThree(bytes, rotation) : unpackRotation(view.getUint32(rotation, true))));
    const e = turn.setFromMatrix4(m.makeRotationFromQuaternion(q)).elements;  // column by column
    const s = [0, 1, 2].map((k) => Math.exp(2 * (bytes[scales + 3 * i + k] / 16 - 10)));
    const covariance = (r, c) => s[0] * e[r] * e[c] + s[1] * e[3 + r] * e[3 + c] + s[2] * e[6 + r] * e[6 + c];
    [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].forEach(([r, c], k) => { floats[at + 7 + k] = covariance(r, c); });
    for (let k = 0; k < perSplat; ++k) {
      const h = harmonics + 3 * (perSplat * i + k);
      words[at + kFirstHarmonic + k] = bytes[h] | bytes[h + 1] << 8 | bytes[h + 2] << 16;
    }
  }
  return { count, degree, positions, words, height };
}

/** Terms of the color by harmonic, from degree 1, at the direction n (Kerbl et al. 2023). */
const kHarmonics = [
  '-0.48860251 * n.y', '0.48860251 * n.z', '-0.48860251 * n.x',
  '1.09254843 * n.x * n.y', '-1.09254843 * n.y * n.z', '0.31539157 * (2.0 * n.z * n.z - n.x * n.x - n.y * n.y)', '-1.09254843 * n.x * n.z',
  '0.54627422 * (n.x * n.x - n.y * n.y)',
  '-0.59004359 * n.y * (3.0 * n.x * n.x - n.y * n.y)', '2.89061144 * n.x * n.y * n.z', '-0.45704580 * n.y * (4.0 * n.z * n.z - n.x * n.x - n.y * n.y)',
  '0.37317633 * n.z * (2.0 * n.z * n.z - 3.0 * n.x * n.x - 3.0 * n.y * n.y)', '-0.45704580 * n.x * (4.0 * n.z * n.z - n.x * n.x - n.y * n.y)',
  '1.44530572 * n.z * (n.x * n.x - n.y * n.y)', '-0.59004359 * n.x * (n.x * n.x - 3.0 * n.y * n.y)',
];

const vertexShader = (degree) => `
precision highp float; precision highp int; precision highp usampler2D;
in vec3 position;
in uint splat;
uniform usampler2D splats;
uniform mat4 viewMatrix, projectionMatrix;
uniform vec3 cameraPosition;
uniform vec2 viewport;  // pixels
out vec4 color;
out vec2 at;  // standard deviations from the center
uvec4 texel(uint k) { return texelFetch(splats, ivec2(int(splat % ${kSplatsPerRow}u * ${kTexelsByDegree[degree]}u + k), int(splat / ${kSplatsPerRow}u)), 0); }
vec3 bytes(uint word) { return (vec3(word & 255u, word >> 8 & 255u, word >> 16 & 255u) - 128.0) / 128.0; }
void main() {
  vec4 a = uintBitsToFloat(texel(0u)), b = uintBitsToFloat(texel(1u)), c = uintBitsToFloat(texel(2u));
  uvec4 d = texel(3u);
  vec3 center = a.xyz, t = (viewMatrix * vec4(center, 1.0)).xyz;
  vec4 clip = projectionMatrix * vec4(t, 1.0);
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);  // outside
  at = vec2(0.0);
  color = vec4(0.0);
  bool isPerspective = projectionMatrix[3][3] == 0.0;
  if (isPerspective && (t.z > -0.1 || any(greaterThan(abs(clip.xy), vec2(1.4 * clip.w))))) return;
  vec2 focal = 0.5 * viewport * vec2(projectionMatrix[0][0], projectionMatrix[1][1]);
  float w = isPerspective ? -t.z : 1.0;
  vec2 slope = isPerspective ? t.xy / (t.z * t.z) : vec2(0.0);
  mat3 J = mat3(focal.x / w, 0.0, 0.0,  0.0, focal.y / w, 0.0,  focal.x * slope.x, focal.y * slope.y, 0.0);
  mat3 T = J * mat3(viewMatrix);
  mat3 S = mat3(b.w, c.x, c.y,  c.x, c.z, c.w,  c.y, c.w, uintBitsToFloat(d.x));
  mat3 P = T * S * transpose(T);
  float xx = P[0][0] + 0.3, xy = P[0][1], yy = P[1][1] + 0.3;  // low pass, as in training
  float middle = 0.5 * (xx + yy), spread = length(vec2(0.5 * (xx - yy), xy));
  vec2 axis = spread < 1e-6 ? vec2(1.0, 0.0) : abs(xy) < 1e-6 ? (xx > yy ? vec2(1.0, 0.0) : vec2(0.0, 1.0)) : normalize(vec2(xy, middle + spread - xx));
  float reach = sqrt(max(0.0, 2.0 * log(255.0 * a.w)));
  at = reach * position.xy;
  vec2 px = at.x * sqrt(middle + spread) * axis + at.y * sqrt(max(0.1, middle - spread)) * vec2(-axis.y, axis.x);
  gl_Position = vec4(clip.xy / clip.w + 2.0 * px / viewport, clip.z / clip.w, 1.0);
  vec3 n = isPerspective ? normalize(center - cameraPosition) : -vec3(viewMatrix[0][2], viewMatrix[1][2], viewMatrix[2][2]);
  vec3 seen = b.xyz;
  ${kHarmonics.slice(0, (degree + 1) ** 2 - 1).map((term, k) => `seen += ${term} * bytes(texel(${(kFirstHarmonic + k) >> 2}u)[${(kFirstHarmonic + k) & 3}]);`).join('\n  ')}
  color = vec4(clamp(seen, 0.0, 1.0), a.w);
}`;

const kFragmentShader = `
precision highp float;
in vec4 color;
in vec2 at;
out vec4 pixel;
void main() {
  float opacity = color.a * exp(-0.5 * dot(at, at));
  if (opacity < 1.0 / 255.0) discard;
  pixel = vec4(opacity * color.rgb, opacity);
}`;

/** Splats as an object of three.js, in its axes. */
export class Splats {
  constructor({ count, degree, positions, words, height }) {
    Object.assign(this, { count, positions });
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]), 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.order = new THREE.InstancedBufferAttribute(new Uint32Array(count), 1).setUsage(THREE.DynamicDrawUsage);
    this.order.gpuType = THREE.IntType;
    geometry.setAttribute('splat', this.order);
    const texture = new THREE.DataTexture(words, kTexelsByDegree[degree] * kSplatsPerRow, height, THREE.RGBAIntegerFormat, THREE.UnsignedIntType);
    texture.internalFormat = 'RGBA32UI';
    texture.needsUpdate = true;
    this.viewport = new THREE.Vector2();
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: vertexShader(degree), fragmentShader: kFragmentShader,
      uniforms: { splats: { value: texture }, viewport: { value: this.viewport } },
      transparent: true, depthWrite: false, blending: THREE.CustomBlending, blendEquation: THREE.AddEquation,
      blendSrc: THREE.OneFactor, blendDst: THREE.OneMinusSrcAlphaFactor,
    });
    this.object = new THREE.Mesh(geometry, material);
    this.object.frustumCulled = false;
    this.keys = new Uint16Array(count);
    this.starts = new Uint32Array(1 << kSortBits);
    this.sortedFrom = null;
  }

  /** Bounds of most splats: without background. */
  get box() {
    const at = (share) => new THREE.Vector3(...[0, 1, 2].map((k) => {
      const values = Float32Array.from({ length: this.count }, (_, i) => this.positions[3 * i + k]).sort();
      return values[Math.floor(share * (this.count - 1))];
    }));
    return new THREE.Box3(at(kOutliers), at(1 - kOutliers));
  }

  /** Before each frame: sorts the splats if the camera has moved, and clips them by `planes`. */
  update(camera, renderer, planes) {
    renderer.getDrawingBufferSize(this.viewport);
    camera.updateMatrixWorld();
    const eye = new THREE.Vector3().setFromMatrixPosition(camera.matrixWorld), ahead = camera.getWorldDirection(new THREE.Vector3());
    const cuts = planes.map(({ normal, constant }) => [...normal.toArray(), constant].join()).join(';'), last = this.sortedFrom;
    if (last && last.cuts === cuts && last.ahead.angleTo(ahead) < kMinTurn && last.eye.distanceTo(eye) < kMinShift) return;
    this.sortedFrom = { eye, ahead, cuts };
    this.sort(eye, ahead, planes);
  }

  /** Sorts by counting of quantized depths (Seward 1954), far to near. */
  sort(eye, ahead, planes) {
    const { count, positions: p, keys, starts, order } = this, depths = new Float32Array(count);
    let min = Infinity, max = -Infinity, shown = 0;
    for (let i = 0; i < count; ++i) {
      const x = p[3 * i], y = p[3 * i + 1], z = p[3 * i + 2];
      if (planes.some(({ normal, constant }) => normal.x * x + normal.y * y + normal.z * z + constant < 0)) {
        depths[i] = NaN;
        continue;
      }
      const depth = depths[i] = (x - eye.x) * ahead.x + (y - eye.y) * ahead.y + (z - eye.z) * ahead.z;
      if (depth < min) min = depth;
      if (depth > max) max = depth;
      ++shown;
    }
    const scale = ((1 << kSortBits) - 1) / Math.max(1e-6, max - min);
    starts.fill(0);
    for (let i = 0; i < count; ++i) {
      if (Number.isNaN(depths[i])) continue;
      keys[i] = (max - depths[i]) * scale;
      ++starts[keys[i]];
    }
    for (let k = 0, sum = 0; k < starts.length; ++k) sum += starts[k], starts[k] = sum - starts[k];
    for (let i = 0; i < count; ++i) if (!Number.isNaN(depths[i])) order.array[starts[keys[i]]++] = i;
    this.object.geometry.instanceCount = shown;
    order.needsUpdate = true;
  }
}
