// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gaussian splats beside the mesh of a finished map.
import assert from 'node:assert/strict';
import { readFileSync, renameSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { Program, inFolder, isAccessible, pictures, run, timeline, until, withBrowser } from './browser.mjs';

const require = createRequire(new URL('../../support/package.json', import.meta.url));
const kColumns = 32, kRows = 20;
const kMaxMeanDifference = 20;  // of 255: blurred splats against the textured mesh
const kMaxMirroredShare = 0.5;  // of the difference from the mirrored mesh

/** Mean colors of a grid of cells of the 3D view. */
const cells = (page) => page.evaluate(([width, height]) => {
  const { cairn: scene } = window, small = Object.assign(document.createElement('canvas'), { width, height });
  scene.render();
  const context = small.getContext('2d');
  context.drawImage(scene.renderer.domElement, 0, 0, width, height);
  return [...context.getImageData(0, 0, width, height).data];
}, [kColumns, kRows]);
const difference = (a, b) => a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / (0.75 * a.length);
const mirrored = (a) => a.map((_, i) => a[i - 4 * (2 * (Math.floor(i / 4) % kColumns) - (kColumns - 1))]);

/** Calls `look(page)` with the complete page of a map. */
async function withMap(open, map, look) {
  const program = new Program('view', map, '--port', '0');
  try {
    const page = await open(await program.url());
    await until(async () => 'complete' in (await timeline(page)));
    await look(page);
    await page.close();
  } finally {
    program.kill('SIGINT');
    await program.ended;
  }
}

/** Fails unless a limit leaves a part of the splats, in their order, with more opacity than the others. */
async function keepsTheMostImportant(file) {
  const bundled = await require('esbuild').build({
    entryPoints: [fileURLToPath(new URL('../../../assets/viewer/splats.js', import.meta.url))], bundle: true, write: false, format: 'esm',
    nodePaths: [fileURLToPath(new URL('../../support/node_modules', import.meta.url))], logLevel: 'warning',
  });
  const { readSpz } = await import(`data:text/javascript;base64,${Buffer.from(bundled.outputFiles[0].contents).toString('base64')}`);
  const all = await readSpz(file), some = await readSpz(file, 500);
  const stride = all.words.length / all.height / 256, opacity = ({ words, count }) => {
    const floats = new Float32Array(words.buffer);
    return Array.from({ length: count }, (_, i) => floats[stride * i + 3]).reduce((sum, value) => sum + value) / count;
  };
  assert.equal(some.count, 500);
  assert.equal(some.degree, all.degree);
  let from = 0;
  for (let i = 0; i < some.count; ++i, ++from)
    while ([0, 1, 2].some((k) => some.positions[3 * i + k] !== all.positions[3 * from + k])) assert.ok(++from < all.count, 'a splat is new');
  assert.ok(opacity(some) > opacity(all));
  assert.equal((await readSpz(file, all.count)).count, all.count);
}

test('splats have the place and the colors of the mesh, and a key shows either', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:40', '--voxel-size', '0.02');
  await withBrowser(async (open) => {
    for (const [name, degree] of [['splats.ply', 0], ['splats.spz', 3]]) {
      run('splat', out, '-o', join(out, name), '--iterations', '80', '--max-splats', '20000', '--hold-out', '0', '--degree', degree);
      await withMap(open, out, async (page) => {
        const mesh = await cells(page), button = page.getByRole('button', { name: 'Gaussian splats' });
        await page.keyboard.press('v');
        await until(() => page.evaluate(() => Boolean(window.cairn.splats)));
        assert.equal(await button.getAttribute('aria-pressed'), 'true');
        assert.ok(await page.evaluate(() => !window.cairn.model.visible && window.cairn.splats.count > 1000));
        const splats = await cells(page), from = difference(splats, mesh), fromMirrored = difference(splats, mirrored(mesh));
        assert.ok(from > 0.1, 'the picture is the same');
        assert.ok(from < kMaxMeanDifference && from < kMaxMirroredShare * fromMirrored, `${name}: ${from}, ${fromMirrored} if mirrored`);
        await page.screenshot({ path: join(pictures, `${name}.png`) });
        await isAccessible(page, name);
        await button.click();
        assert.equal(await button.getAttribute('aria-pressed'), 'false');
        assert.ok(difference(mesh, await cells(page)) < 0.5);
      });
      if (name === 'splats.ply') renameSync(join(out, name), join(folder, name));
    }
    await keepsTheMostImportant(readFileSync(join(out, 'splats.spz')));
    for (const file of [join(folder, 'splats.ply'), join(out, 'splats.spz')])
      await withMap(open, file, async (page) => {
        assert.equal(await page.locator('#status').textContent(), 'Gaussian splats');
        assert.equal(await page.locator('#empty').count(), 0);
        const before = await cells(page), colors = new Set(before.map((value) => value >> 4));
        assert.ok(colors.size > 8, 'the picture is empty');
        await page.keyboard.press('a');
      });
    // Damaged splats leave the rest of the page as it is.
    writeFileSync(join(out, 'splats.spz'), 'damaged');
    await withMap(open, out, async (page) => {
      await page.keyboard.press('v');
      await until(async () => /The splats are not shown here/.test(await page.locator('#panel').innerText()));
      assert.ok(await page.evaluate(() => window.cairn.model.visible));
    });
  });
}));
