// SPDX-License-Identifier: MIT
// Driving by keys: a velocity as long as they are held, sent again and again, and zero once they are let go.

const SEND_MS = 50;
const DIRECTIONS = {
  KeyW: [1, 0, 0], KeyS: [-1, 0, 0], KeyA: [0, 1, 0], KeyD: [0, -1, 0], KeyQ: [0, 0, 1], KeyE: [0, 0, -1],
  ArrowUp: [1, 0, 0], ArrowDown: [-1, 0, 0], ArrowLeft: [0, 1, 0], ArrowRight: [0, -1, 0],
};

export class Keys {
  #held = new Set();
  #timer = null;
  enabled = false;
  top = { v: 0, w: 0 }; // what the robot reaches in every direction
  share = 0.3;

  constructor(socket, on) {
    this.socket = socket;
    this.on = on; // {refused(text), moving(text)}
    addEventListener("keydown", (event) => this.#down(event));
    addEventListener("keyup", (event) => this.#up(event.code));
    addEventListener("blur", () => this.stop());
    document.addEventListener("visibilitychange", () => document.hidden && this.stop());
  }

  stop() {
    this.#held.clear();
    this.#ended();
  }

  #down(event) {
    if (!this.enabled || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!(event.code in DIRECTIONS) || event.target.closest?.("input:not([type=checkbox]), select, textarea, dialog")) return;
    event.preventDefault();
    this.#held.add(event.code);
    if (this.#timer !== null) return;
    this.#send();
    this.#timer = setInterval(() => this.#send(), SEND_MS);
  }

  #up(code) {
    if (!this.#held.delete(code)) return;
    if (this.#held.size === 0) this.#ended();
  }

  #ended() {
    if (this.#timer === null) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.socket.send({ do: "velocity", vx: 0, vy: 0, wz: 0 });
    this.on.moving("");
  }

  #send() {
    let [x, y, turn] = [0, 0, 0];
    for (const code of this.#held) {
      const [dx, dy, dturn] = DIRECTIONS[code];
      [x, y, turn] = [Math.sign(x + dx), Math.sign(y + dy), Math.sign(turn + dturn)];
    }
    // Driving and turning at once share what the wheels can do.
    const part = this.share / (Math.hypot(x, y) && turn ? 2 : 1) / Math.max(1, Math.hypot(x, y));
    const request = { vx: x * part * this.top.v, vy: y * part * this.top.v, wz: turn * part * this.top.w };
    this.on.moving(`${request.vx.toFixed(2)}, ${request.vy.toFixed(2)} m/s, ${request.wz.toFixed(2)} rad/s`);
    this.socket.ask("velocity", request).catch(({ error, hint }) => {
      this.stop();
      this.on.refused(hint ? `${error}. ${hint}` : error);
    });
  }
}
