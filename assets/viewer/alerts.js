// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Tells who looks at the room and not at the page that the camera is lost, and when it is found again.

const kKept = 'cairn-alerts';
const kTones = { lost: [660, 440], found: [440, 660] };  // Hz, one after the other
const kTone = 0.16;                                      // seconds
const kVibrations = { lost: [250, 100, 250], found: [80] };  // milliseconds

function kept() {
  try {
    return localStorage.getItem(kKept) === 'on';
  } catch {
    return false;  // the browser keeps nothing, by its settings
  }
}

/** Sound and vibration are off until somebody switches them on: browsers want a tap before the first tone. */
export class Alerts {
  constructor() {
    this.isOn = kept();
    // Also where it was on before, the first tone needs a tap on this page.
    for (const type of ['pointerdown', 'keydown'])
      addEventListener(type, () => { if (this.isOn) this.wake(); }, { capture: true });
  }

  set(on) {
    this.isOn = on;
    try {
      localStorage.setItem(kKept, on ? 'on' : 'off');
    } catch { /* the next page begins without */ }
    if (!on) return;
    this.wake();
    this.tell('found');
  }

  wake() {
    if (!window.AudioContext) return;
    this.audio ??= new AudioContext();
    if (this.audio.state === 'suspended') this.audio.resume();
  }

  /** `what`: lost or found. Everybody sees it; who wants to hears and feels it. */
  tell(what) {
    const flash = document.getElementById('flash');
    if (flash) {
      flash.className = '';
      void flash.offsetWidth;  // the animation begins again
      flash.className = what;
    }
    if (!this.isOn) return;
    navigator.vibrate?.(kVibrations[what]);
    if (this.audio?.state !== 'running') return;
    kTones[what].forEach((frequency, i) => {
      const begin = this.audio.currentTime + i * kTone, tone = this.audio.createOscillator(), volume = this.audio.createGain();
      tone.frequency.value = frequency;
      volume.gain.setValueAtTime(0.0001, begin);
      volume.gain.exponentialRampToValueAtTime(0.3, begin + 0.02);
      volume.gain.exponentialRampToValueAtTime(0.0001, begin + kTone);
      tone.connect(volume).connect(this.audio.destination);
      tone.start(begin);
      tone.stop(begin + kTone);
    });
  }
}
