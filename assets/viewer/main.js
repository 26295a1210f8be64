// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Entry point of the page, for growing and finished maps. The data are in the page itself (report.html) or beside it.
import { setStatus } from './dom.js';
import { showFinished } from './finished.js';
import { foldingPanel, tooltips } from './layout.js';
import { showLive } from './live.js';
import { Scene } from './scene.js';

async function main() {
  const inline = document.getElementById('data');
  const asked = inline ? null : fetch('data.json');
  const fold = foldingPanel();
  tooltips();
  const scene = new Scene(document.getElementById('scene'));  // slow, overlaps with the request
  window.cairn = scene;  // for the console and for tests
  const data = inline ? JSON.parse(inline.textContent) : await (await asked).json();
  if (data.mode === 'live') showLive(scene, fold);
  else await showFinished(scene, data, fold);
}

main().catch((error) => {
  setStatus('gone', `The map cannot be shown: ${error.message}`);
  throw error;
});
