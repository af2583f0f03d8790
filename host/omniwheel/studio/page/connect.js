// SPDX-License-Identifier: MIT
// The dialog in which a robot is chosen: a simulated one, a port, an address.

import { in_words } from "./words.js";

export class Chooser {
  #id = (name) => document.getElementById(name);

  constructor(socket) {
    this.socket = socket;
    this.dialog = this.#id("connect-dialog");
    this.#id("choose").onclick = () => this.open();
    this.#id("close-dialog").onclick = () => this.dialog.close();
    this.#id("disconnect").onclick = () => this.#try("disconnect", {});
    this.#id("simulate-form").onsubmit = (event) => {
      event.preventDefault();
      const robot = this.#id("robot-file").value;
      this.#try("simulate", { scenario: this.#id("scenario").value, robot: robot || null });
    };
    this.#id("port-form").onsubmit = (event) => {
      event.preventDefault();
      this.#try("connect", { url: this.#id("url").value.trim() });
    };
  }

  async open() {
    this.#id("connect-trouble").textContent = "";
    if (!this.dialog.open) this.dialog.showModal();
    const choices = await this.socket.ask("choices");
    const before = this.#id("scenario").value || "sitl";
    this.#id("scenario").replaceChildren(
      ...Object.entries(choices.scenarios).map(([name, words]) => new Option(`${name}: ${words}`, name)));
    this.#id("scenario").value = before;
    this.#id("robot-file").replaceChildren(
      new Option("the scenario's", ""), ...choices.robots.map((name) => new Option(name, name)));
    this.#id("ports").replaceChildren(...choices.ports.map(({ url, what }) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${url}${what ? ` (${what})` : ""}`;
      button.onclick = () => this.#try("connect", { url });
      return button;
    }));
    if (choices.ports.length === 0) this.#id("ports").textContent = "No serial port is there.";
  }

  async #try(action, content) {
    const trouble = this.#id("connect-trouble");
    trouble.textContent = "Working …";
    try {
      await this.socket.ask(action, content);
      trouble.textContent = "";
      this.dialog.close();
    } catch (refusal) {
      trouble.textContent = in_words(refusal);
    }
  }
}
