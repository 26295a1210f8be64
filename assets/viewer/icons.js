// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Icons as strokes in a 24 x 24 square.

const kStrokes = {
  start: 'M3 11 12 4l9 7M6 9v11h12V9M10 20v-6h4v6',
  all: 'M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M9 9h6v6H9z',
  plan: 'M4 4h16v16H4zM4 12h7M14 12h6M11 4v4M11 12v8',
  measure: 'M3 16 16 3l5 5L8 21zM7 12l2 2M10 9l3 3M13 6l2 2',
  section: 'M12 3l8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12 4 7.5',
  distance: 'M12 12m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0M12 12m-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0M12 12m-10 0a10 10 0 1 0 20 0a10 10 0 1 0-20 0',
  walk: 'M13 4m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0M9 21l2.5-6M15 21l-1-5-3-3 1-5-4 2v4M12 8l2 3 3 1',
  path: 'M4 19c5 0 3-7 8-7s3-7 8-7M4 19m-1.5 0a1.5 1.5 0 1 0 3 0a1.5 1.5 0 1 0-3 0M17 2l4 3-4 3',
  colors: 'M12 3a9 9 0 1 0 0 18c2 0 2-1.500 1.500-3s.5-2.500 2.500-2.500h2.500c1.500 0 2.500-1 2.500-3.500a9 9 0 0 0-9-9M7.500 12h.01M9.500 8h.01M14.500 8h.01',
  shape: 'M12 3l8 4.500v9L12 21l-8-4.500v-9zM4 7.500l8 4.500 8-4.500M12 12v9M16 10v9M8 10v9',
  grid: 'M4 4h16v16H4zM4 9.300h16M4 14.600h16M9.300 4v16M14.600 4v16',
  splats: 'M9 8m-5 0a5 3.500 0 1 0 10 0a5 3.500 0 1 0-10 0M16 14m-4 0a4 5 0 1 0 8 0a4 5 0 1 0-8 0M6 17m-2.500 0a2.500 2 0 1 0 5 0a2.500 2 0 1 0-5 0',
  picture: 'M3 8h4l2-3h6l2 3h4v11H3zM12 13m-3.500 0a3.500 3.500 0 1 0 7 0a3.500 3.500 0 1 0-7 0',
  full: 'M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5',
  help: 'M9 9a3 3 0 1 1 4 2.800c-1 .4-1 1.200-1 2.200M12 17.500h.01M12 12m-9.500 0a9.500 9.500 0 1 0 19 0a9.500 9.500 0 1 0-19 0',
  panel: 'M4 5h16v14H4zM14 5v14M16.500 9h1.500M16.500 12h1.500',
  close: 'M6 6l12 12M18 6 6 18',
  follow: 'M12 12m-7 0a7 7 0 1 0 14 0a7 7 0 1 0-14 0M12 12m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0M12 2v4M12 18v4M2 12h4M18 12h4',
  coverage: 'M12 4C7 4 3.500 8 2 12c1.500 4 5 8 10 8s8.500-4 10-8c-1.500-4-5-8-10-8M12 12m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0',
  sound: 'M4 9v6h4l5 4V5L8 9zM16 9a4 4 0 0 1 0 6M18.500 6.500a8 8 0 0 1 0 11',
  arrow: 'M3 12h17M13 5l7 7-7 7',
  play: 'M8 5v14l11-7z',
  pause: 'M8 5v14M16 5v14',
};

export function icon(name) {
  const kSpace = 'http://www.w3.org/2000/svg';
  const svg = document.createElementNS(kSpace, 'svg'), path = document.createElementNS(kSpace, 'path');
  for (const [key, value] of Object.entries({ viewBox: '0 0 24 24', class: 'icon', 'aria-hidden': 'true' })) svg.setAttribute(key, value);
  path.setAttribute('d', kStrokes[name]);
  svg.append(path);
  return svg;
}
