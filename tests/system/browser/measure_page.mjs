// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Times of `cairn view` and of report.html in headless Chromium: from navigation to the first picture of the surface, to
// the decoded texture, and to the complete mesh with all tools. Usage: node measure_page.mjs MAP [times]
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { Program, timeline, until, withBrowser } from './browser.mjs';

const [map, times = 3] = process.argv.slice(2);
const program = new Program('view', map, '--port', '0');
const pages = { view: await program.url(), 'report.html': pathToFileURL(join(resolve(map), 'report.html')).href };
await withBrowser(async (open) => {
  for (const [name, url] of Object.entries(pages))
    for (let i = 0; i < times; ++i) {
      const page = await open('about:blank', { width: 1400, height: 900 });
      // Excludes the start of the browser, of its window and of its rendering.
      await page.evaluate(() => document.createElement('canvas').getContext('webgl2').clear(0));
      await page.waitForTimeout(4000);
      await page.goto(url);
      await until(async () => 'complete' in (await timeline(page)));
      const { picture, texture, complete } = await timeline(page);
      console.log(`${name}: first picture ${picture.toFixed(2)} s, ${texture ? `texture ${texture.toFixed(2)} s, ` : ''}complete ${complete.toFixed(2)} s`);
      await page.close();
    }
});
program.kill('SIGINT');
await program.ended;
