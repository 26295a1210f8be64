// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Measures `cairn live --view` with one viewer. Usage: node measure_live.mjs SEQUENCE OUT reader|page [arguments of
// cairn live]. reader: receives all data without drawing, as with the page open on another machine; page: the page
// itself, drawn by this machine, and a picture of it.
import { join } from 'node:path';
import { Program, pictures, triangles, until, withBrowser } from './browser.mjs';

const [sequence, out, viewer, ...more] = process.argv.slice(2);
let program;
await withBrowser(async (open, errors) => {
  const page = await open('about:blank');  // excludes the browser's own start
  await page.waitForTimeout(2000);
  const begin = Date.now();
  program = new Program('live', sequence, '-o', out, '--view', '--port', '0', '--json', ...(sequence.startsWith('openni:') ? [] : ['--real-time']), ...more);
  const url = await program.url();
  if (viewer === 'page') {
    await page.goto(url);
    await until(async () => (await triangles(page)) > 0);
    const first = Date.now() - begin;
    await page.waitForTimeout(6000);
    await page.screenshot({ path: join(pictures, 'live-measured.jpg'), quality: 82 });
    console.log(`first mesh in the page after ${first} ms, with the start of the program`);
  } else {
    await page.route(url, (route) => route.fulfill({ contentType: 'text/html', body: '' }));  // the origin, no page
    await page.goto(url);
    await page.evaluate((address) => {
      window.received = 0;
      const socket = new WebSocket(address.replace('http', 'ws') + 'live');
      socket.binaryType = 'arraybuffer';
      socket.onmessage = ({ data }) => { window.received += data.byteLength ?? data.length; };
    }, url);
  }
  await program.ended;
  errors.length = 0;  // the connection ended with the program
});
const report = JSON.parse(program.output.slice(program.output.indexOf('\n{')));
console.log(JSON.stringify({ live: report.live, frames: report.frames, stages: Object.fromEntries(
    Object.entries(report.stages).map(([stage, { median_ms: ms }]) => [stage, Math.round(10 * ms) / 10])) }, null, 1));
