// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What surrounds the picture, whatever is in it: the panel that folds away, and words beside what is pointed at.
import { element } from './dom.js';
import { icon } from './icons.js';

const kWide = 1000;  // pixels from which the panel is open at first
const kKept = 'cairn-panel';

/** The browser may keep nothing, by its settings. */
function kept() {
  try {
    return localStorage.getItem(kKept);
  } catch {
    return null;
  }
}

function keep(value) {
  try {
    localStorage.setItem(kKept, value);
  } catch { /* the next page begins as this one did */ }
}

/** `fold(open)` opens or folds the panel; without `open` the other of the two. */
export function foldingPanel() {
  const button = document.getElementById('fold'), panel = document.getElementById('panel');
  button.append(icon('panel'));
  const show = (open) => {
    panel.hidden = !open;
    button.setAttribute('aria-expanded', open);
    button.setAttribute('aria-label', open ? 'Fold the panel away' : 'Open the panel');
    button.dataset.tip = `${open ? 'Fold the panel away' : 'About this map'}`;
  };
  const fold = (open = panel.hidden) => {
    show(open);
    keep(open ? 'open' : 'folded');
  };
  button.addEventListener('click', () => fold());
  show(kept() ? kept() === 'open' : innerWidth >= kWide);
  return fold;
}

/** Shows `data-tip` of what the pointer rests on, or the keyboard has reached. */
export function tooltips() {
  const tip = element('div', { id: 'tip', hidden: true, aria: { hidden: 'true' } });
  document.body.append(tip);
  const show = (target) => {
    tip.hidden = !target;
    if (!target) return;
    tip.textContent = target.dataset.tip;
    const at = target.getBoundingClientRect(), size = tip.getBoundingClientRect();
    const beside = at.left + at.width < innerWidth / 2 && at.height < innerHeight / 2 && target.closest('#tools');
    const left = beside ? at.right + 8 : at.left + at.width / 2 - size.width / 2;
    const top = beside ? at.top + at.height / 2 - size.height / 2 : at.bottom + 8 + size.height < innerHeight ? at.bottom + 8 : at.top - size.height - 8;
    tip.style.left = `${Math.max(4, Math.min(left, innerWidth - size.width - 4))}px`;
    tip.style.top = `${Math.max(4, top)}px`;
  };
  const of = (event) => event.target.closest?.('[data-tip]');
  document.addEventListener('pointerover', (event) => { if (event.pointerType === 'mouse') show(of(event)); });
  document.addEventListener('focusin', (event) => show(event.target.matches(':focus-visible') ? of(event) : null));
  document.addEventListener('focusout', () => show(null));
  document.addEventListener('pointerdown', () => show(null));
  addEventListener('keydown', (event) => { if (event.key === 'Escape') show(null); });
}
