// SPDX-License-Identifier: MIT
// Firmware for a board: choose it, have it checked, upload what was checked. All words about it come from the server.

import { in_words } from "./words.js";

const A_FILE = "";

export class Flasher {
  #id = (name) => document.getElementById(name);
  #told = "";
  #passed = false; // what is chosen has been checked, and nothing was changed since
  #running = false;

  constructor(socket) {
    this.socket = socket;
    this.#id("flash-what").onchange = () => this.#choose();
    this.#id("flash-form").oninput = () => { this.#passed = false; this.#buttons(); };
    this.#id("flash-form").onsubmit = (event) => { event.preventDefault(); this.#ask({}); };
    this.#id("flash-upload").onclick = () => this.#ask({ upload: true });
    this.#id("flash-end").onclick = () => this.#ask({ end: true });
  }

  /** choices: {robots, ports: [{url, what}]} */
  choices({ robots, ports }) {
    const [what, port] = [this.#id("flash-what").value, this.#id("flash-port").value];
    this.#id("flash-what").replaceChildren(
      ...robots.map((name) => new Option(`built from the source for ${name}`, name)), new Option("a .hex file", A_FILE));
    if (what) this.#id("flash-what").value = what;
    this.#id("flash-port").replaceChildren(
      new Option("the one that is plugged in", ""), ...ports.map(({ url }) => new Option(url, url)),
      new Option("without a serial port: I press its button", "blank"));
    this.#id("flash-port").value = port;
    this.#choose();
  }

  #choose() {
    this.#id("flash-file-label").hidden = this.#id("flash-what").value !== A_FILE;
  }

  async #ask(more) {
    const [robot, port] = [this.#id("flash-what").value, this.#id("flash-port").value];
    const file = robot === A_FILE ? this.#id("flash-file").value.trim() : "";
    const blank = port === "blank";
    try {
      await this.socket.ask("flash", { robot, file, port: blank ? "" : port, blank, ...more });
    } catch (refusal) {
      this.#id("flash-text").textContent = in_words(refusal);
    }
  }

  #buttons() {
    this.#id("flash-upload").disabled = !this.#passed || this.#running;
    this.#id("flash-end").hidden = !this.#running;
  }

  /** now: {running, uploads, lines, done, trouble, checked}; null without a server */
  state(now) {
    const told = JSON.stringify(now);
    if (told === this.#told || now === null) return;
    this.#told = told;
    this.#running = now.running;
    this.#passed = now.checked;
    this.#buttons();
    const doing = now.uploads ? "Uploading …" : "Building and checking …";
    this.#id("flash-text").textContent = now.running ? doing : now.trouble || now.done;
    const lines = this.#id("flash-lines");
    lines.hidden = now.lines.length === 0;
    lines.textContent = now.lines.join("\n");
    lines.scrollTop = lines.scrollHeight;
  }
}
