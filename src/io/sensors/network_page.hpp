// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once

namespace cairn {

/// Page of a WebSocket receiver: shows state.json and color.jpg, each second.
inline constexpr const char* kNetworkPage = R"(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Cairn: camera over a network</title>
<style>
:root { color-scheme: dark; }
body { margin: 0; background: #14171b; color: #e8eaed; font: 14px/1.45 system-ui, sans-serif; }
#state { padding: 12px 14px; background: #2f63c4; color: #fff; font-weight: 600; }
#state[data-state="tracking"] { background: #1d7a46; }
#state[data-state="lost"], #state[data-state="gone"] { background: #c9343a; }
dl { margin: 14px; display: grid; grid-template-columns: max-content auto; gap: 4px 14px; }
dt { color: #a9b2bc; }
dd { margin: 0; }
img { margin: 0 14px; width: 320px; max-width: calc(100% - 28px); border-radius: 8px; }
</style>
<div id="state" role="status">Connecting</div>
<dl><dt>Client</dt><dd id="client"></dd><dt>Camera</dt><dd id="camera"></dd><dt>Frames</dt><dd id="frames"></dd>
<dt>Dropped</dt><dd id="dropped"></dd><dt>Last error</dt><dd id="error"></dd></dl>
<img id="color" alt="Last color image" hidden>
<script>
const at = id => document.getElementById(id);
async function update() {
  let state = 'gone';
  try {
    const json = await (await fetch('state.json')).json();
    state = json.state;
    for (const id of ['client', 'camera', 'frames', 'dropped', 'error']) at(id).textContent = json[id];
    at('color').hidden = !json.has_color;
    if (json.has_color) at('color').src = 'color.jpg?' + json.frames;
  } catch (error) { /* the program has ended */ }
  at('state').dataset.state = state;
  at('state').textContent = {waiting: 'Waiting for a client', received: 'Receiving frames', tracking: 'Tracking', lost: 'Tracking is lost', gone: 'The program has ended'}[state];
}
update();
setInterval(update, 1000);
</script>
</html>
)";

}  // namespace cairn
