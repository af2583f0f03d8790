// SPDX-License-Identifier: MIT
// A held velocity: repeated until its release, which sends zero.

import { in_words } from "./words.js";

const SEND_MS = 50;

export class HeldVelocity {
  #timer = null;
  #direction = null;
  #refused = false; // until it is let go: a refusal is said once
  top = { v: 0, w: 0 }; // what the robot reaches in every direction
  share = 0.3;

  constructor(socket, on) {
    this.socket = socket;
    this.on = on; // {refused(text), begins(), moving(text)}
  }

  get held() { return this.#timer !== null; }

  /** @param direction function: forward, left and counter-clockwise, each -1..1 of the share of what the robot can. */
  hold(direction) {
    this.#direction = direction;
    if (this.held || this.#refused) return;
    this.on.begins();
    this.#timer = setInterval(() => this.#send(), SEND_MS);
    this.#send();
  }

  letGo() {
    this.#refused = false;
    if (!this.held) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.socket.send({ do: "velocity", vx: 0, vy: 0, wz: 0 });
    this.on.moving("");
  }

  #send() {
    const [x, y, turn] = this.#direction();
    // Driving and turning at once share what the wheels can do.
    const part = this.share / Math.max(1, Math.hypot(x, y) + Math.abs(turn));
    const request = { vx: x * part * this.top.v, vy: y * part * this.top.v, wz: turn * part * this.top.w };
    this.on.moving(`${request.vx.toFixed(2)}, ${request.vy.toFixed(2)} m/s, ${request.wz.toFixed(2)} rad/s`);
    this.socket.ask("velocity", request).catch((refusal) => {
      this.letGo();
      this.#refused = true;
      this.on.refused(in_words(refusal));
    });
  }
}
