// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time from the request of a .glb to its picture, in three.js in headless Chromium. Usage: node measure_export.mjs
// X.glb [OUT.png]
import { statSync } from 'node:fs';
import { basename, dirname, resolve } from 'node:path';
import { exportPage, withBrowser } from './browser.mjs';

const [file, picture] = process.argv.slice(2);
await withBrowser(async (open) => {
  const { page, close } = await exportPage(open, dirname(resolve(file)));
  const seen = await page.evaluate((url) => window.openGltf(url), `/${basename(file)}`);
  if (picture) await page.screenshot({ path: picture });
  close();
  console.log(`${(statSync(file).size / 1e6).toFixed(2)} MB, ${seen.triangles} triangles, shown after ${(seen.ms / 1000).toFixed(2)} s`);
});
