// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The toolbar: names of the buttons, keyboard shortcuts, and the card of the active tool.
import { element } from './dom.js';
import { icon } from './icons.js';

/** True if the focused element accepts text input. */
const isTyping = (target) => target.matches?.('textarea, select, input:not([type=range]):not([type=radio]):not([type=checkbox])');

const kMouse = [
  ['Drag, one finger', 'Turn'], ['Right button, two fingers', 'Move'], ['Wheel, pinch', 'Nearer and farther'],
  ['Double click', 'Turn about this place'], ['Arrow keys', 'Turn, once the picture has the focus'],
];

export class Toolbar {
  constructor() {
    this.bar = document.getElementById('tools');
    this.card = document.getElementById('card');
    this.buttons = [];
    this.shown = null;  // tool with an open card
    this.life = new AbortController();
    document.addEventListener('keydown', (event) => this.onKey(event), { signal: this.life.signal });
  }

  /** Removes the toolbar before another takes its place. */
  end() {
    this.life.abort();
    this.closeCard();
    this.bar.replaceChildren();
    document.getElementById('help')?.remove();
  }

  /** `name`: description; `label`: text below the icon; `press()`: the action. */
  add({ name, label, key, symbol, press }) {
    const made = element('button', { onclick: () => press(), aria: { label: name } }, icon(symbol), element('span', {}, label));
    made.dataset.tip = `${name} (${key.toUpperCase()})`;
    made.setAttribute('aria-keyshortcuts', key);
    this.buttons.push({ name, key, press, made });
    this.bar.append(made);
    return made;
  }

  /** Adds a shortcut for a button outside the toolbar. */
  addKey(button) { this.buttons.push(button); }

  /**
   * Adds a tool: a card with its settings (`body`), `start()` and `end()`, which may be asynchronous. A `lasting` tool
   * remains active when another card is opened, until its button is pressed again.
   */
  addTool(tool) {
    tool.made = this.add({ ...tool, press: () => this.press(tool) });
    tool.made.setAttribute('aria-pressed', 'false');
    tool.isOn = false;
    return tool;
  }

  press(tool) {
    if (this.shown !== tool) return this.show(tool);
    this.switchOff(tool);
  }

  show(tool) {
    this.closeCard();
    this.shown = tool;
    const close = element('button', { className: 'plain', onclick: () => { this.closeCard(); tool.made.focus(); }, aria: { label: `Close ${tool.title}` } }, icon('close'));
    const off = tool.lasting ? [element('button', { onclick: () => { this.switchOff(tool); tool.made.focus(); } }, tool.off ?? 'Switch off')] : [];
    this.card.replaceChildren(element('header', {}, element('h2', {}, tool.title), close), tool.body, ...off);
    this.card.setAttribute('aria-label', tool.title);
    this.card.hidden = false;
    if (tool.isOn) return;
    this.setOn(tool, true);
    tool.start();
  }

  /** Closes the card; lasting tools remain active. */
  closeCard() {
    const tool = this.shown;
    if (!tool) return;
    this.shown = null;
    this.card.hidden = true;
    if (!tool.lasting) this.switchOff(tool);
  }

  switchOff(tool) {
    if (this.shown === tool) {
      this.shown = null;
      this.card.hidden = true;
    }
    if (!tool.isOn) return;
    this.setOn(tool, false);
    tool.end();
  }

  setOn(tool, on) {
    tool.isOn = on;
    tool.made.setAttribute('aria-pressed', on);
  }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target) || document.querySelector('dialog[open]')) return;
    if (this.shown?.onKey?.(event)) return event.preventDefault();
    if (event.key === 'Escape') return this.closeCard();
    const button = this.buttons.find(({ key }) => key === event.key.toLowerCase());
    if (!button || event.repeat) return;
    event.preventDefault();
    button.press();
  }

  /** Adds the list of all keys. */
  addHelp() {
    const sheet = element('dialog', { id: 'help', aria: { label: 'Keys' } });
    const row = ([key, words]) => element('tr', {}, element('th', { scope: 'row' }, element('kbd', {}, key)), element('td', {}, words));
    const show = () => {
      const keys = [...this.buttons.map(({ key, name }) => [key.toUpperCase(), name]), ['Esc', 'Close the tool']];
      sheet.replaceChildren(
          element('header', {}, element('h2', {}, 'Keys and mouse'),
                  element('button', { className: 'plain', onclick: () => sheet.close(), aria: { label: 'Close the keys' } }, icon('close'))),
          element('div', { className: 'keys' }, element('table', {}, ...keys.map(row)), element('table', {}, ...kMouse.map(row))));
      sheet.showModal();
    };
    sheet.addEventListener('click', (event) => { if (event.target === sheet) sheet.close(); });
    sheet.addEventListener('keydown', (event) => { if (event.key === '?') sheet.close(); });
    document.body.append(sheet);
    this.add({ name: 'Show the keys', label: 'Keys', key: '?', symbol: 'help', press: show });
  }
}
