// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Alerts the operator, who watches the room instead of the page, when the camera is lost and when it is found again.

const kStorageKey = 'cairn-alerts';
const kTones = { lost: [660, 440], found: [440, 660] };      // Hz, in sequence
const kToneSeconds = 0.16;                                   // seconds
const kVibrations = { lost: [250, 100, 250], found: [80] };  // milliseconds

function isStored() {
  try {
    return localStorage.getItem(kStorageKey) === 'on';
  } catch {
    return false;  // storage is disabled in the browser
  }
}

/** Sound and vibration, off by default: browsers require a tap before the first tone. */
export class Alerts {
  constructor() {
    this.isOn = isStored();
    // The first tone requires a tap on this page, even if sound was on before.
    for (const type of ['pointerdown', 'keydown'])
      addEventListener(type, () => { if (this.isOn) this.wake(); }, { capture: true });
  }

  set(on) {
    this.isOn = on;
    try {
      localStorage.setItem(kStorageKey, on ? 'on' : 'off');
    } catch { /* not stored */ }
    if (!on) return;
    this.wake();
    this.notify('found');
  }

  wake() {
    if (!window.AudioContext) return;
    this.audio ??= new AudioContext();
    if (this.audio.state === 'suspended') this.audio.resume();
  }

  /** `event`: lost or found. The flash is always shown; sound and vibration only when switched on. */
  notify(event) {
    const flash = document.getElementById('flash');
    if (flash) {
      flash.className = '';
      void flash.offsetWidth;  // restarts the animation
      flash.className = event;
    }
    if (!this.isOn) return;
    navigator.vibrate?.(kVibrations[event]);
    if (this.audio?.state !== 'running') return;
    kTones[event].forEach((frequency, i) => {
      const begin = this.audio.currentTime + i * kToneSeconds, tone = this.audio.createOscillator(), volume = this.audio.createGain();
      tone.frequency.value = frequency;
      volume.gain.setValueAtTime(0.0001, begin);
      volume.gain.exponentialRampToValueAtTime(0.3, begin + 0.02);
      volume.gain.exponentialRampToValueAtTime(0.0001, begin + kToneSeconds);
      tone.connect(volume).connect(this.audio.destination);
      tone.start(begin);
      tone.stop(begin + kToneSeconds);
    });
  }
}
