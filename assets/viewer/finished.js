// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A finished map: its mesh, how the camera went, and how well it was tracked.
import uPlot from 'uplot';
import { element, facts, setStatus, viewButtons } from './dom.js';

const kColours = ['#4c8dff', '#37b26c', '#e0a32e', '#e5484d', '#a879e8', '#35b5c9', '#d46fa8', '#9aa3ad'];
const kStages = ['preprocess', 'raycast', 'track', 'fuse', 'keyframe', 'esdf', 'esdf to host'];

function chart(title, frames, series, unit) {
  const holder = element('div');
  const axis = { stroke: '#9aa3ad', grid: { stroke: '#333b45' }, ticks: { stroke: '#333b45' } };
  const number = (v) => (v == null ? '–' : v.toFixed(v < 10 ? 1 : 0));
  new uPlot({
    width: 334, height: 170, padding: [6, 6, 0, 0],
    scales: { x: { time: false }, y: { range: (_, low, high) => [0, Math.max(high, 1) * 1.05] } },
    axes: [axis, { ...axis, size: 58, values: (_, values) => values.map((v) => `${v} ${unit}`) }],
    series: [{ label: 'frame' }, ...series.map(({ label }, i) => (
      { label, stroke: kColours[i % kColours.length], width: 1, points: { show: false }, value: (_, v) => number(v) }))],
  }, [frames, ...series.map(({ values }) => values)], holder);
  return [element('h2', {}, title), holder];
}

const megabytes = (mb) => `${mb.toFixed(0)} MB`;

function decoded(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

export async function showFinished(scene, data) {
  const { report } = data, panel = document.getElementById('panel');
  document.title = `${data.name} – Cairn`;
  document.getElementById('buttons').append(...viewButtons(scene));
  const { frames } = report, per = report.per_frame ?? [];
  setStatus(frames.lost > 0.1 * frames.total ? 'weak' : 'good', `${frames.fused} of ${frames.total} frames fused`);

  panel.append(element('h1', {}, data.name));
  for (const warning of report.warnings ?? []) panel.append(element('div', { className: 'warning' }, warning));
  if (data.mesh_left_out)
    panel.append(element('div', { className: 'warning' }, `The mesh is too large for this page: cairn view shows ${data.mesh_left_out}`));
  const time = report.seconds == null ? [] : [
    ['Time', `${report.seconds.toFixed(1)} s`], ['Frames a second', report.frames_per_second.toFixed(1)]];
  const list = [
    ['Sequence', report.sequence], ['Frames', `${frames.fused} fused, ${frames.lost} lost, ${frames.skipped} unusable`],
    ['Triangles', report.mesh?.triangles.toLocaleString('en') ?? 'not written'], ['Keyframes', report.keyframes],
    ['Loops', report.loops.length], ...time, ['Peak memory', megabytes(report.peak_memory_mb)],
    ['Memory on the device', megabytes(report.device_memory_peak_mb)], ['Device', report.device],
  ];
  if (report.live)
    list.push(['Skipped to keep up', report.live.skipped_to_keep_up], ['Frame to pose, 95 %', `${report.live.latency_ms.p95.toFixed(0)} ms`]);
  if (report.tilt_degrees != null) list.push(['Tilt against gravity', `${report.tilt_degrees.toFixed(2)}°`]);
  panel.append(facts(list));

  const index = per.map((f) => f.index), share = (v) => (v == null ? null : 100 * v);
  if (per.length > 1) {
    panel.append(...chart('Tracking', index, [
      { label: 'inliers', values: per.map((f) => share(f.inlier_share)) },
      { label: 'overlap', values: per.map((f) => share(f.overlap)) },
      { label: 'lost', values: per.map((f) => (f.state === 'lost' ? 0 : null)) },
    ], '%'));
    const used = kStages.filter((stage) => per.some((f) => f.ms?.[stage] > 0.1));
    panel.append(...chart('Time by stage', index,
                          used.map((label) => ({ label, values: per.map((f) => f.ms?.[label] ?? null) })), 'ms'));
  }
  const begin = data.trajectory[0]?.[0] ?? 0;
  if (report.loops.length > 0)
    panel.append(element('h2', {}, 'Loops'), element('ul', { className: 'loops' }, ...report.loops.map((loop) => element(
        'li', { className: loop.inlier ? '' : 'refused' },
        `${(loop.from - begin).toFixed(1)} s ↔ ${(loop.to - begin).toFixed(1)} s, ${loop.corners} corners`))));
  panel.append(element('h2', {}, 'Parameters'), facts(Object.entries(report.options)));

  scene.setPath(new Float32Array(data.trajectory.flatMap(([t, x, y, z]) => [t - begin, x, y, z])));
  scene.setLoops(report.loops.filter((loop) => loop.inlier).map((loop) => [loop.from - begin, loop.to - begin]));
  const bytes = data.mesh_base64 ? decoded(data.mesh_base64) : data.mesh ? await (await fetch(data.mesh)).arrayBuffer() : null;
  try {
    if (bytes) await scene.setModel(bytes);
    else scene.lookAtAll();
  } catch (error) {  // Draco's decoder is not in this page
    panel.prepend(element('div', { className: 'warning' }, `The mesh is not shown here: ${error.message}`));
    scene.lookAtAll();
  }
}
