// SPDX-License-Identifier: MIT
// Driving by keys, as long as they are held.

const DIRECTIONS = {
  KeyW: [1, 0, 0], KeyS: [-1, 0, 0], KeyA: [0, 1, 0], KeyD: [0, -1, 0], KeyQ: [0, 0, 1], KeyE: [0, 0, -1],
  ArrowUp: [1, 0, 0], ArrowDown: [-1, 0, 0], ArrowLeft: [0, 1, 0], ArrowRight: [0, -1, 0],
};

const TYPED = "input:not([type=checkbox]), select, textarea, dialog"; // there a key is something else

export class Keys {
  #held = new Set();
  enabled = false;

  constructor(velocity) {
    this.velocity = velocity;
    addEventListener("keydown", (event) => this.#down(event));
    addEventListener("keyup", (event) => this.#up(event.code));
    addEventListener("blur", () => this.stop());
    document.addEventListener("visibilitychange", () => document.hidden && this.stop());
  }

  stop() {
    if (this.#held.size) this.velocity.letGo();
    this.#held.clear();
  }

  #down(event) {
    if (!this.enabled || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!(event.code in DIRECTIONS) || event.target.closest?.(TYPED)) return;
    event.preventDefault();
    this.#held.add(event.code);
    this.velocity.hold(() => this.#direction());
  }

  #up(code) {
    if (this.#held.delete(code) && this.#held.size === 0) this.velocity.letGo();
  }

  #direction() {
    const sum = [0, 0, 0];
    for (const code of this.#held) DIRECTIONS[code].forEach((part, axis) => { sum[axis] += part; });
    return sum.map(Math.sign);
  }
}
