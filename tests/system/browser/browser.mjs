// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Shared code of the browser tests: the program, Debian's Chromium, and pages whose console must stay free of errors.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const require = createRequire(new URL('../../support/package.json', import.meta.url));
const { chromium } = require('playwright-core');

const build = fileURLToPath(new URL('../../../build/release/', import.meta.url));
export const cairn = process.env.CAIRN_PROGRAM ?? join(build, 'cairn');
export const pictures = process.env.CAIRN_PICTURES ?? join(build, 'pictures');
mkdirSync(pictures, { recursive: true });

/** Runs `test(folder)` in a new temporary folder. */
export async function inFolder(test) {
  const folder = mkdtempSync(join(tmpdir(), 'cairn-browser-'));
  try {
    await test(folder);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

export function run(...args) {
  const ran = spawnSync(cairn, args, { encoding: 'utf8' });
  if (ran.status !== 0) throw new Error(`cairn ${args.join(' ')}: ${ran.stderr}`);
  return ran.stdout;
}

/** Running program: its output so far, and its end. */
export class Program {
  constructor(...args) {
    this.output = '';
    this.process = spawn(cairn, args);
    for (const stream of [this.process.stdout, this.process.stderr])
      stream.setEncoding('utf8').on('data', (text) => { this.output += text; });
    this.ended = new Promise((resolve) => this.process.on('close', (code, signal) => resolve(code ?? signal)));
  }
  /** URL of the program's server. */
  async url() {
    await until(() => /http:\S+/.test(this.output), () => `no address was printed: ${this.output}`);
    return this.output.match(/http:\S+/)[0];
  }
  kill(signal) { this.process.kill(signal); }
}

export async function until(condition, what = () => 'it did not happen', seconds = 60) {
  const end = Date.now() + 1000 * seconds;
  while (!(await condition())) {
    if (Date.now() > end) throw new Error(await what());
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** Calls `test(open)`; `open(url, size, initial script, options of the context)` returns a page. Fails if a page writes an error to its console. */
export async function withBrowser(test) {
  const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!executablePath) throw new Error('Chromium is missing: run scripts/install-deps --tests');
  const browser = await chromium.launch({
    executablePath, args: ['--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader'],
  });
  const errors = [];
  try {
    await test(async (url, viewport = { width: 1280, height: 800 }, beforehand = () => {}, options = {}) => {
      const page = await browser.newPage({ viewport, ...options });
      page.setDefaultNavigationTimeout(120000);  // a page with an embedded mesh, on shared cores
      await page.addInitScript(beforehand);
      page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
      page.on('pageerror', (error) => errors.push(String(error)));
      await page.goto(url);
      return page;
    }, errors);
  } finally {
    await browser.close();
  }
  if (errors.length > 0) throw new Error(`the page complained: ${errors.join('\n')}`);
}

export const triangles = (page) => page.evaluate(() => window.cairn?.triangles ?? 0);

/** Marks of a page in seconds from its navigation: its first picture, its texture, the complete map. */
export const timeline = (page) => page.evaluate(() => Object.fromEntries(performance.getEntriesByType('mark').map(({ name, startTime }) => [name, startTime / 1000])));

const axe = () => readFileSync(fileURLToPath(new URL('../../support/node_modules/axe-core/axe.min.js', import.meta.url)), 'utf8');

/** Fails if axe-core finds serious accessibility faults: contrast, names, keyboard access. */
export async function isAccessible(page, what) {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(axe());
  const found = await page.evaluate(async () => (await window.axe.run()).violations
      .filter(({ impact }) => impact === 'serious' || impact === 'critical')
      .map(({ id, nodes }) => `${id}: ${nodes.map(({ html, failureSummary }) => `${html} ${failureSummary}`).join('; ')}`));
  assert.deepEqual(found, [], what);
}

/** Page that opens exported files of `folder` by a script, which defines `ready` in the window; see export_page.js. `close()` ends its server. */
export async function exportPage(open, folder, script = 'export_page.js', ready = 'openTiles') {
  const { build } = require('esbuild');
  const bundled = await build({
    entryPoints: [fileURLToPath(new URL(script, import.meta.url))], bundle: true, write: false, format: 'esm',
    nodePaths: [fileURLToPath(new URL('../../support/node_modules', import.meta.url))], logLevel: 'warning',
  });
  const draco = fileURLToPath(new URL('../../support/node_modules/three/examples/jsm/libs/draco/gltf/', import.meta.url));
  const types = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json', '.wasm': 'application/wasm' };
  const server = createServer((request, response) => {
    const path = new URL(request.url, 'http://x').pathname;
    const send = (body, type) => response.writeHead(200, { 'Content-Type': type }).end(body);
    if (path === '/') return send('<!doctype html><link rel="icon" href="data:,"><body><script type="module" src="/page.js"></script>', 'text/html');
    if (path === '/page.js') return send(bundled.outputFiles[0].contents, 'text/javascript');
    const file = path.startsWith('/draco/') ? join(draco, path.slice(7)) : join(folder, path);
    if (!existsSync(file)) return response.writeHead(404).end();
    return send(readFileSync(file), types[extname(file)] ?? 'application/octet-stream');
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  server.unref();
  const page = await open(`http://127.0.0.1:${server.address().port}/`, { width: 1000, height: 640 });
  await until(() => page.evaluate((name) => name in window, ready));
  return { page, close: () => server.close() };
}
