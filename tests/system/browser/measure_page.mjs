// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Times of `cairn view` in headless Chromium: from navigation to the first picture of the surface, to the decoded
// texture, and to the complete mesh with all tools. Usage: node measure_page.mjs MAP [times]
import { Program, timeline, until, withBrowser } from './browser.mjs';

const [map, times = 3] = process.argv.slice(2);
const program = new Program('view', map, '--port', '0'), url = await program.url();
await withBrowser(async (open) => {
  // Excludes the start of the browser and of its rendering.
  const warm = await open('about:blank');
  await warm.evaluate(() => document.createElement('canvas').getContext('webgl2').clear(0));
  await warm.waitForTimeout(3000);
  for (let i = 0; i < times; ++i) {
    const page = await open(url, { width: 1400, height: 900 });
    await until(async () => 'complete' in (await timeline(page)));
    const { picture, texture, complete } = await timeline(page);
    console.log(`first picture ${picture.toFixed(2)} s, texture ${texture.toFixed(2)} s, complete ${complete.toFixed(2)} s`);
    await page.close();
  }
});
program.kill('SIGINT');
await program.ended;
