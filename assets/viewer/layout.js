// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Layout around the 3D view: the folding panel and tooltips.
import { element } from './dom.js';
import { icon } from './icons.js';

const kMinOpenWidth = 1000;  // minimum window width in pixels for an open panel
const kStorageKey = 'cairn-panel';

/** Screens with room for a tool's card or the panel, not for both; as in style.css. */
export const kPhone = matchMedia('(max-width: 560px), (max-width: 760px) and (orientation: portrait), (max-height: 560px)');

/** Stored state; null if storage is disabled in the browser. */
function stored() {
  try {
    return localStorage.getItem(kStorageKey);
  } catch {
    return null;
  }
}

function store(value) {
  try {
    localStorage.setItem(kStorageKey, value);
  } catch { /* not stored */ }
}

/** `fold(open)` opens or folds the panel; toggles it without an argument. `show(open)` does so for this page alone. */
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
    store(open ? 'open' : 'folded');
  };
  button.addEventListener('click', () => fold());
  const card = document.getElementById('card');
  new MutationObserver(() => { if (kPhone.matches && !card.hidden) show(false); }).observe(card, { attributeFilter: ['hidden'] });
  show(stored() ? stored() === 'open' : innerWidth >= kMinOpenWidth);
  return Object.assign(fold, { show });
}

/** Shows `data-tip` of the hovered or focused element. */
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
