// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers

/** An element: its properties, then its children; text is never read as HTML. */
export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export function facts(list) {
  return element('dl', {}, ...list.flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, String(value))]));
}

export function setStatus(status, words) {
  const shown = document.getElementById('status');
  shown.dataset.status = status;
  shown.textContent = words;
}

/** Buttons that every view of a map has. */
export function viewButtons(scene) {
  const look = element('button', { onclick: () => show(scene.look === 'colour' ? 'shape' : 'colour') });
  const show = (name) => {
    scene.setLook(name);
    look.textContent = name === 'colour' ? 'Show shape' : 'Show colour';
  };
  show('colour');
  return [look, element('button', { onclick: () => { scene.setFollow(false); scene.lookAtAll(); } }, 'Show all')];
}
