// SPDX-License-Identifier: MIT
// The dialog in which a robot is chosen: a simulated one, a port, an address.

import { in_words } from "./words.js";

export class Chooser {
  #processors = [];
  #id = (name) => document.getElementById(name);

  constructor(socket, flasher, say) {
    this.say = say;
    this.socket = socket;
    this.flasher = flasher;
    this.dialog = this.#id("connect-dialog");
    this.#id("choose").onclick = () => this.open();
    this.#id("close-dialog").onclick = () => this.dialog.close();
    this.#id("disconnect").onclick = () => this.#try("disconnect", {});
    this.#id("simulate-form").onsubmit = (event) => {
      event.preventDefault();
      const robot = this.#id("robot-file").value;
      const processor = this.#id("processor").value;
      const image = this.#id("image-label").hidden ? "" : this.#id("image").value.trim();
      this.#try("simulate", { scenario: this.#id("scenario").value, robot: robot || null, processor, image });
    };
    this.#id("processor").onchange = () => this.#processor();
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
    this.flasher.choices(choices);
    this.#processors = choices.processors;
    const chosen = this.#id("processor").value || choices.processors[0].name;
    this.#id("processor").replaceChildren(...choices.processors.map(({ name, words }) => new Option(words, name)));
    this.#id("processor").value = chosen;
    this.#processor();
    this.#id("ports").replaceChildren(...choices.ports.map(({ url, what }) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${url}${what ? ` (${what})` : ""}`;
      button.onclick = () => this.#try("connect", { url });
      return button;
    }));
    if (choices.ports.length === 0) this.#id("ports").textContent = "No serial port is there.";
  }

  /** Show what the chosen processor needs: a file, or something that is not installed. */
  #processor() {
    const { problem, files } = this.#processors.find(({ name }) => name === this.#id("processor").value);
    this.#id("processor-problem").textContent = problem;
    this.#id("image-label").hidden = files === null;
    this.#id("images").replaceChildren(...(files ?? []).map(({ path }) => new Option(path, path)));
    if (!files?.length || this.#id("image").value) return;
    this.#id("image").value = files[0].path;
    this.#id("robot-file").value = files[0].robot; // what it was built for is at its pins
  }

  async #try(action, content) {
    const trouble = this.#id("connect-trouble");
    trouble.textContent = "Working …";
    try {
      await this.socket.ask(action, content);
      trouble.textContent = "";
      this.say("");
      this.dialog.close();
    } catch (refusal) {
      trouble.textContent = in_words(refusal);
    }
  }
}
