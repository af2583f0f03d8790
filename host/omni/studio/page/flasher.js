// SPDX-License-Identifier: MIT
// Firmware for a board: choose it, have it checked, upload what was checked. All words about it come from the server.

import { id, in_words, put } from "./words.js";

const A_FILE = "";

export class Flasher {
  #told = "";
  #passed = false; // what is chosen has been checked, and nothing was changed since
  #running = false;

  constructor(socket) {
    this.socket = socket;
    id("flash-what").onchange = () => this.#choose();
    id("flash-form").oninput = () => { this.#passed = false; this.#buttons(); };
    id("flash-form").onsubmit = (event) => { event.preventDefault(); this.#ask({}); };
    id("flash-upload").onclick = () => this.#ask({ upload: true });
    id("flash-end").onclick = () => this.#ask({ end: true });
  }

  /** choices: {robots, ports: [{url, what}]} */
  choices({ robots, ports }) {
    const [what, port] = [id("flash-what").value, id("flash-port").value];
    id("flash-what").replaceChildren(
      ...robots.map((name) => new Option(`built from the source for ${name}`, name)),
      new Option("a .hex file", A_FILE));
    if (what) id("flash-what").value = what;
    id("flash-port").replaceChildren(
      new Option("the connected one", ""), ...ports.map(({ url }) => new Option(url, url)),
      new Option("without a serial port: press its button", "blank"));
    id("flash-port").value = port;
    this.#choose();
  }

  #choose() {
    id("flash-file-label").hidden = id("flash-what").value !== A_FILE;
  }

  async #ask(more) {
    const [robot, port] = [id("flash-what").value, id("flash-port").value];
    const file = robot === A_FILE ? id("flash-file").value.trim() : "";
    const blank = port === "blank";
    try {
      await this.socket.ask("flash", {
        robot, file, port: blank ? "" : port, blank, new_wiring: id("flash-wiring").checked, ...more });
    } catch (refusal) {
      put("flash-text", in_words(refusal));
    }
  }

  #buttons() {
    id("flash-upload").disabled = !this.#passed || this.#running;
    id("flash-end").hidden = !this.#running;
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
    put("flash-text", now.running ? doing : now.trouble || now.done);
    const lines = id("flash-lines");
    lines.hidden = now.lines.length === 0;
    lines.textContent = now.lines.join("\n");
    lines.scrollTop = lines.scrollHeight;
  }
}
