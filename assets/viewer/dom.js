// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers

/** Creates an element from properties and children; text is never parsed as HTML. */
export function element(tag, properties = {}, ...children) {
  const { aria = {}, ...others } = properties;
  const made = Object.assign(document.createElement(tag), others);
  for (const [name, value] of Object.entries(aria)) made.setAttribute(name === 'role' ? name : `aria-${name}`, value);
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
  shown.title = words;  // for truncated text
}

/** A labeled slider; `show(value)` formats its value. `set(value)` moves it without calling `input`. */
export function slider({ label, min = 0, max = 1, step = 0.01, value = min, show = String, input }) {
  const range = element('input', { type: 'range', min, max, step, value });
  const output = element('output');
  const update = () => {
    output.textContent = show(Number(range.value));
    range.setAttribute('aria-valuetext', output.textContent);
  };
  range.addEventListener('input', () => { update(); input(Number(range.value)); });
  update();
  const container = element('label', { className: 'slider' }, element('span', {}, label), range, output);
  return Object.assign(container, { range, set: (to) => { range.value = to; update(); } });
}

/** Radio buttons: `options` are [value, words]. */
export function choice(label, options, value, change) {
  const name = `choice-${label.replaceAll(' ', '-').toLowerCase()}`;
  const made = options.map(([of, words]) => {
    const radio = element('input', { type: 'radio', name, value: of, checked: of === value, onchange: () => change(of) });
    return element('label', {}, radio, element('span', {}, words));
  });
  const group = element('fieldset', { className: 'choice' }, element('legend', {}, label), ...made);
  return Object.assign(group, {
    set: (to) => { for (const radio of group.querySelectorAll('input')) radio.checked = radio.value === to; },
  });
}

export function checkbox(words, checked, change) {
  const box = element('input', { type: 'checkbox', checked, onchange: () => change(box.checked) });
  return element('label', { className: 'check' }, box, element('span', {}, words));
}

export function save(url, name) {
  element('a', { href: url, download: name }).click();
}
