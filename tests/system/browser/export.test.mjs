// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Exported files in Chromium: every variant of glTF in three.js, 3D Tiles in 3d-tiles-renderer.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import test from 'node:test';
import { exportPage, inFolder, pictures, run, triangles, until, withBrowser } from './browser.mjs';

test('three.js opens every glTF, and 3d-tiles-renderer the tiles', () => inFolder(async (folder) => {
  const map = join(folder, 'map');
  run('reconstruct', 'synthetic:room', '-o', map, '--frames', '0:60:4', '--voxel-size', '0.02', '--simplify', '0.2',
    '--texture', '--compress', 'meshopt');
  const write = (name, ...options) => JSON.parse(run('export', map, '-o', join(folder, name), '--json', ...options));
  const files = {
    'plain.glb': ['--simplify', '0.1', '--no-texture'],
    'plain.gltf': ['--simplify', '0.1', '--texture', '--cameras'],
    'quantized.glb': ['--simplify', '0.1', '--compress', 'quantized', '--texture-format', 'png'],
    'meshopt.glb': ['--simplify', '0.1', '--compress', 'meshopt', '--texture'],
    'meshopt.gltf': ['--simplify', '0.1', '--compress', 'meshopt', '--cell-size', '1.5', '--no-texture'],
    'draco.glb': ['--simplify', '0.1', '--compress', 'draco', '--texture'],
  };
  const exported = Object.fromEntries(Object.entries(files).map(([name, options]) => [name, write(name, ...options)]));
  const tiles = write('tiles/tileset.json', '--simplify', '0.3', '--cell-size', '1.5', '--texture', '--compress', 'meshopt');
  await withBrowser(async (open) => {
    const { page, close } = await exportPage(open, folder);
    try {
      for (const [name, options] of Object.entries(files)) {
        const seen = await page.evaluate((url) => window.openGltf(url), `/${name}`);
        assert.equal(seen.triangles, exported[name].triangles, name);
        assert.equal(seen.meshes, exported[name].parts, name);
        assert.equal(seen.textured, options.includes('--no-texture') ? 0 : exported[name].parts, name);
        assert.equal(seen.lines, options.includes('--cameras') ? 1 : 0, name);
        assert.equal(seen.cameras > 2, options.includes('--cameras'), name);
        assert.equal(seen.extras.up_axis, 'y');
        assert.equal(seen.extras.source, 'map');
        assert.ok(seen.drawn > 0.05, `${name}: ${seen.drawn} of the picture is drawn`);
        await page.screenshot({ path: join(pictures, `export-${name}.png`) });
      }
      const coarse = await page.evaluate(() => window.openTiles('/tiles/tileset.json', 1e6));
      const fine = await page.evaluate(() => window.openTiles('/tiles/tileset.json', 1e-3));
      await page.screenshot({ path: join(pictures, 'export-tiles.png') });
      assert.deepEqual([...coarse.failed, ...fine.failed], []);
      assert.equal(fine.triangles, tiles.triangles);
      assert.ok(coarse.triangles < 0.6 * fine.triangles, `${coarse.triangles} of ${fine.triangles}`);
      assert.ok(coarse.visible < fine.visible);
      assert.ok(coarse.drawn > 0.05 && Math.abs(coarse.drawn - fine.drawn) < 0.03, `${coarse.drawn} ${fine.drawn}`);
    } finally {
      close();
    }

    // The project's own page supports textures and meshopt as well.
    const report = await open(pathToFileURL(join(map, 'report.html')).href);
    await until(async () => (await triangles(report)) > 0);
    await report.waitForTimeout(3000);  // software WebGL
    await report.screenshot({ path: join(pictures, 'report-textured.png') });
    assert.equal(await report.locator('.warning').count(), 0);
  });
}));
