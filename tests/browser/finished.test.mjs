// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A finished map in Chromium: report.html from the disk, and cairn view.
import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';
import { Program, inFolder, pictures, run, triangles, until, withBrowser } from './browser.mjs';

test('report.html and cairn view show the mesh, the charts and the facts', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const report = JSON.parse(run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:30', '--json'));
  await withBrowser(async (open) => {
    const page = await open(pathToFileURL(join(out, 'report.html')).href);
    await until(async () => (await triangles(page)) === report.mesh.triangles);
    assert.equal(await page.locator('#status').textContent(), '30 of 30 frames fused');
    assert.equal(await page.locator('.uplot canvas').count(), 2);
    assert.match(await page.locator('#panel').textContent(), /voxel_size/);
    await page.waitForTimeout(500);
    await page.screenshot({ path: join(pictures, 'report.png') });
    await page.getByRole('button', { name: 'Show shape' }).click();
    assert.equal(await page.getByRole('button', { name: 'Show colour' }).count(), 1);

    const program = new Program('view', out, '--port', '0');
    const served = await open(await program.url());
    await until(async () => (await triangles(served)) === report.mesh.triangles);
    assert.equal(await served.locator('#status').textContent(), '30 of 30 frames fused');
    await served.close();
    program.kill('SIGINT');
    assert.equal(await program.ended, 0);
  });
}));

test('the page is small', () => inFolder(async (folder) => {
  run('synth', 'plane', '-o', join(folder, 'recording'), '--frames', '2');
  run('reconstruct', join(folder, 'recording'), '-o', join(folder, 'map'), '--voxel-size', '0.04');
  const program = new Program('view', join(folder, 'map'), '--port', '0');
  const page = await (await fetch(await program.url())).text();
  program.kill('SIGINT');
  await program.ended;
  assert.ok(page.length < 1.5e6, `${page.length} bytes`);
  assert.ok(!/https?:\/\/(?!www\.w3\.org|127\.0\.0\.1)[^"'`\s)]*\.js/.test(page), 'a script comes from elsewhere');
  assert.ok(statSync(join(folder, 'map', 'report.html')).size > page.length);
}));
