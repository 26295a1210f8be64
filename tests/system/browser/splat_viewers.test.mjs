// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Splats in viewers of other programs: Spark and three.js show them where the mesh is, in all formats.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { exportPage, inFolder, pictures, run, withBrowser } from './browser.mjs';

const kWidth = 96, kHeight = 72;
const kMaxMeanDifference = 20;    // of 255: splats after a short training against the textured mesh
const kFocalLength = 525, kRows = 480;  // pixels, of the synthetic camera

/** Mean absolute difference of the colors of `a` at (u, v) and of `b` at change(u, v), where both have a surface; u and v from -1 to 1. */
function difference(a, b, change) {
  let sum = 0, count = 0;
  const dark = (pixels, i) => pixels[i] + pixels[i + 1] + pixels[i + 2] < 12;
  for (let y = 0; y < kHeight; ++y)
    for (let x = 0; x < kWidth; ++x) {
      const [u, v] = change((2 * x + 1) / kWidth - 1, (2 * y + 1) / kHeight - 1);
      const column = Math.floor((u + 1) * kWidth / 2), row = Math.floor((v + 1) * kHeight / 2);
      if (column < 0 || row < 0 || column >= kWidth || row >= kHeight) continue;
      const i = 4 * (y * kWidth + x), j = 4 * (row * kWidth + column);
      if (dark(a, i) || dark(b, j)) continue;
      for (let c = 0; c < 3; ++c) sum += Math.abs(a[i + c] - b[j + c]) / 3;
      ++count;
    }
  return count > 0.25 * kWidth * kHeight ? sum / count : 255;
}

const kSame = (u, v) => [u, v];
const kChanges = {
  'mirrored': (u, v) => [-u, v], 'upside down': (u, v) => [u, -v], 'rotated': (u, v) => [-u, -v],
  'larger': (u, v) => [u / 1.06, v / 1.06], 'smaller': (u, v) => [u / 0.94, v / 0.94],
  'shifted right': (u, v) => [u + 0.06, v], 'shifted left': (u, v) => [u - 0.06, v],
  'shifted down': (u, v) => [u, v + 0.08], 'shifted up': (u, v) => [u, v - 0.08],
};

/** Cameras of a trajectory in the axes of glTF: x right, y up, z back. */
function cameras(map, count) {
  const poses = readFileSync(join(map, 'trajectory.txt'), 'utf8').split('\n').filter((line) => /^[\d.]/.test(line)).map((line) => line.split(/\s+/).map(Number));
  return Array.from({ length: count }, (_, k) => poses[Math.floor((k + 0.5) * poses.length / count)]).map(([, x, y, z, qx, qy, qz, qw]) => ({
    position: [x, -y, -z], quaternion: [qx, -qy, -qz, qw], aspect: 4 / 3, fov: 2 * Math.atan(kRows / 2 / kFocalLength) * 180 / Math.PI,
  }));
}

test('Spark and three.js show splats with the axes and the scale of the mesh', () => inFolder(async (folder) => {
  const map = join(folder, 'map');
  run('reconstruct', 'synthetic:room', '-o', map, '--frames', '0:40', '--voxel-size', '0.02', '--texture');
  for (const name of ['x.ply', 'x.spz', 'x.glb'])
    run('splat', map, '-o', join(folder, name), '--iterations', '60', '--max-splats', '20000', '--hold-out', '0');
  await withBrowser(async (open) => {
    const { page, close } = await exportPage(open, folder, 'splat_viewers_page.js', 'draw');
    try {
      const draw = (viewer, url, camera) => page.evaluate((all) => window.draw(...all), [viewer, url, camera, kWidth, kHeight]);
      for (const camera of cameras(map, 2)) {
        const mesh = await draw('mesh', '/map/mesh.glb', camera);
        for (const [viewer, name] of [['spark', 'x.ply'], ['spark', 'x.spz'], ['three', 'x.ply'], ['three', 'x.spz'], ['three', 'x.glb']]) {
          const seen = await draw(viewer, `/${name}`, camera), same = difference(mesh, seen, kSame);
          await page.screenshot({ path: join(pictures, `splats-${viewer}-${name}.png`) });
          assert.ok(same < kMaxMeanDifference, `${name} in ${viewer}: ${same}`);
          for (const [what, change] of Object.entries(kChanges)) {
            const changed = difference(mesh, seen, change);
            assert.ok(same < changed, `${name} in ${viewer}: ${same}, ${what}: ${changed}`);
          }
        }
      }
    } finally {
      close();
    }
  });
}));
