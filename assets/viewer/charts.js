// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Charts of tracking quality and time per frame, with marks at lost frames.
import uPlot from 'uplot';
import { element } from './dom.js';

const kColors = ['#6ea2ff', '#49c282', '#e0a32e', '#ff7b7f', '#b490f0', '#4cc7da', '#e086b8', '#aab2bb'];
const kStages = ['preprocess', 'raycast', 'track', 'fuse', 'keyframe', 'esdf', 'esdf to host'];
const kLost = '#ff5d5d';

/** Marks at frames, over the full height. */
function drawMarks(chart, frames) {
  const { ctx, bbox: { top, height } } = chart;
  ctx.save();
  ctx.fillStyle = `${kLost}99`;
  for (const frame of frames) ctx.fillRect(chart.valToPos(frame - 0.5, 'x', true), top, Math.max(2, chart.valToPos(frame + 0.5, 'x', true) - chart.valToPos(frame - 0.5, 'x', true)), height);
  ctx.restore();
}

function chart(title, words, frames, series, unit, lost = []) {
  const holder = element('div', { className: 'chart', aria: { role: 'img', label: words } });
  const axis = { stroke: '#9aa3ad', grid: { stroke: '#333b45' }, ticks: { stroke: '#333b45' } };
  const number = (v) => (v == null ? '' : `${v.toFixed(v < 10 ? 1 : 0)} ${unit}`);
  const plot = new uPlot({
    width: 320, height: 160, padding: [6, 6, 0, 0],
    scales: { x: { time: false }, y: { range: (_, low, high) => [0, Math.max(high, 1) * 1.05] } },
    axes: [axis, { ...axis, size: 68, values: (_, values) => values.map((v) => `${v} ${unit}`) }],
    series: [{ label: 'frame', value: (_, v) => (v == null ? '' : String(v)) }, ...series.map(({ label }, i) => (
      { label, stroke: kColors[i % kColors.length], width: 1, points: { show: false }, value: (_, v) => number(v) }))],
    hooks: { draw: [(made) => drawMarks(made, lost)] },
  }, [frames, ...series.map(({ values }) => values)], holder);
  new ResizeObserver(() => { if (holder.clientWidth > 0) plot.setSize({ width: holder.clientWidth, height: 160 }); }).observe(holder);
  const marks = lost.length > 0 ? [element('p', { className: 'hint is-lost' }, `${lost.length === 1 ? '1 lost frame' : `${lost.length} lost frames`}`)] : [];
  return [element('h2', {}, title), holder, ...marks];
}

/** Charts of a report's `per_frame`. */
export function charts(frames) {
  if (frames.length < 2) return [];
  const index = frames.map((f) => f.index), share = (v) => (v == null ? null : 100 * v);
  const lost = frames.filter(({ state }) => state === 'lost').map((f) => f.index);
  const used = kStages.filter((stage) => frames.some((f) => f.ms?.[stage] > 0.1));
  return [
    ...chart('Tracking', 'Inliers and overlap of each frame in per cent; lost frames are marked', index, [
      { label: 'inliers', values: frames.map((f) => share(f.inlier_share)) },
      { label: 'overlap', values: frames.map((f) => share(f.overlap)) },
    ], '%', lost),
    ...chart('Time by stage', 'Milliseconds that each stage took, frame by frame', index,
             used.map((label) => ({ label, values: frames.map((f) => f.ms?.[label] ?? null) })), 'ms'),
  ];
}
