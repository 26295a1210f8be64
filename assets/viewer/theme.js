// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Light or dark colors by the browser's preference, for the parts of the page drawn by scripts.

const kLight = matchMedia('(prefers-color-scheme: light)');

/** Value of a color variable of style.css. */
export const themeColor = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Calls `apply` immediately and after each change of the preference. */
export function onTheme(apply) {
  apply();
  kLight.addEventListener('change', apply);
}
