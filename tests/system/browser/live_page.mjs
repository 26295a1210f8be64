// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Live page with a simulated program: a real stream cannot produce arbitrary states.
import { createServer } from 'node:http';
import { until } from './browser.mjs';

/** Runs in the page, before its script. */
function simulateProgram() {
  window.asked = [];
  window.heard = { tones: [], vibrations: [] };
  window.WebSocket = class {
    static OPEN = 1;
    readyState = 1;
    constructor() {
      window.live = this;
      setTimeout(() => this.onopen?.());
    }
    send(text) { window.asked.push(JSON.parse(text).do); }
    receive(state) { this.onmessage({ data: JSON.stringify(state) }); }
    /** Sends a surface one meter before the camera, of `size` meters, with a coverage from 0 on the left to 255. */
    sendPlane(size) {
      const side = 33, vertices = side * side, quads = (side - 1) ** 2;
      const bytes = new ArrayBuffer(48 + vertices * 16 + quads * 12), head = new DataView(bytes);
      [1, 1, 0, 0, 0, 0].forEach((v, i) => head.setInt32(4 * i, v, true));
      [-size / 2, -size / 2, 1, size].forEach((v, i) => head.setFloat32(24 + 4 * i, v, true));
      [vertices, 6 * quads].forEach((v, i) => head.setUint32(40 + 4 * i, v, true));
      const positions = new Uint16Array(bytes, 48, 4 * vertices), colors = new Uint8Array(bytes, 48 + 8 * vertices, 4 * vertices),
            normals = new Int8Array(bytes, 48 + 12 * vertices, 4 * vertices), indices = new Uint16Array(bytes, 48 + 16 * vertices);
      for (let v = 0; v < vertices; ++v) {
        const x = v % side / (side - 1), y = Math.floor(v / side) / (side - 1);
        positions.set([65535 * x, 65535 * y, 0, 0], 4 * v);
        colors.set([180, 140, 100, 255 * x], 4 * v);
        normals.set([0, 0, -127, 0], 4 * v);
      }
      for (let q = 0; q < quads; ++q) {
        const a = Math.floor(q / (side - 1)) * side + q % (side - 1);
        indices.set([a, a + side, a + 1, a + 1, a + side, a + side + 1], 6 * q);
      }
      this.onmessage({ data: bytes });
    }
  };
  navigator.vibrate = (pattern) => window.heard.vibrations.push(pattern);
  window.AudioContext = class {
    state = 'suspended';
    currentTime = 0;
    resume() { this.state = 'running'; }
    createOscillator() {
      const tone = { frequency: { value: 0 }, connect: (next) => next, start: () => window.heard.tones.push(tone.frequency.value), stop: () => {} };
      return tone;
    }
    createGain() {
      return { gain: { setValueAtTime() {}, exponentialRampToValueAtTime() {} }, connect: (next) => next };
    }
  };
}

/** State of a scan that goes well. */
export const going = {
  epoch: 1, status: 'good', words: 'Tracking well', guidance: { level: 'good', words: 'Tracking well' },
  frames: { fused: 120, lost: 3 }, skipped_to_keep_up: 7, memory_mb: 412.3, loops: [], keyframes: 9, submaps: 1,
  frames_per_second: 24.3, latency_ms: 41, camera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
  view: { fx: 0.82, aspect: 4 / 3, depth: 1 }, last_frame: { near: 0, far: 0.1, empty: 0.2, brightness: 0.5, inlier_share: 0.91, rmse: 1.3 },
};

/** `html`: the page, as served by the program; `files`: other served files, by name: [type, body]. */
export async function livePage(open, html, viewport, files = {}, options = {}) {
  const server = createServer((request, response) => {
    const name = new URL(request.url, 'http://x').pathname.slice(1);
    const [type, body] = { '': ['text/html', html], 'data.json': ['application/json', '{"mode":"live"}'], ...files }[name] ?? [];
    response.writeHead(type ? 200 : 404, { 'Content-Type': type ?? 'text/plain' }).end(body);
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  server.unref();
  const page = await open(`http://127.0.0.1:${server.address().port}/`, viewport, simulateProgram, options);
  await until(() => page.evaluate(() => Boolean(window.live?.onmessage && window.cairn)));
  const receive = (more = {}) => page.evaluate((state) => window.live.receive(state), { ...going, ...more });
  return { page, receive, sendPlane: (size) => page.evaluate((meters) => window.live.sendPlane(meters), size), close: () => server.close() };
}

/** Share of the picture's pixels that are not background, and the colors along its middle row. */
export const pixels = (page) => page.evaluate(() => {
  const { renderer, scene, camera } = window.cairn, gl = renderer.getContext();
  renderer.render(scene, camera);
  const { drawingBufferWidth: width, drawingBufferHeight: height } = gl, bytes = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const ground = scene.background.getHex(), is = (i) => [16, 8, 0].reduce((sum, shift, k) => sum + Math.abs(bytes[4 * i + k] - (ground >> shift & 255)), 0) > 12;
  let covered = 0;
  for (let i = 0; i < width * height; ++i) covered += is(i);
  const middle = Math.floor(height / 2) * width;
  return { covered: covered / (width * height), row: Array.from({ length: width }, (_, x) => [...bytes.subarray(4 * (middle + x), 4 * (middle + x) + 3)]) };
});
