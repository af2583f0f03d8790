// SPDX-License-Identifier: MIT
// The dialog in which a robot is chosen: a simulated one, a port, an address.

import { all_numbers, number_in } from "./numbers.js";
import { id, in_words, put } from "./words.js";

export class Chooser {
  #processors = [];

  constructor(socket, flasher, say) {
    this.say = say;
    this.socket = socket;
    this.flasher = flasher;
    this.dialog = id("connect-dialog");
    id("choose").onclick = () => this.open();
    id("close-dialog").onclick = () => this.dialog.close();
    id("disconnect").onclick = () => this.#try("disconnect", {});
    id("simulate-form").onsubmit = (event) => {
      event.preventDefault();
      const robot = id("robot-file").value;
      const processor = id("processor").value;
      const image = id("image-label").hidden ? "" : id("image").value.trim();
      this.#try("simulate", { scenario: id("scenario").value, robot: robot || null, processor, image });
    };
    id("processor").onchange = () => this.#processor();
    id("port-form").onsubmit = (event) => {
      event.preventDefault();
      this.#connect(id("url").value.trim());
    };
  }

  #connect(url) {
    if (all_numbers(id("system"))) this.#try("connect", { url, system: number_in(id("system")) });
  }

  async open() {
    put("connect-trouble", "");
    if (!this.dialog.open) this.dialog.showModal();
    try {
      this.#offer(await this.socket.ask("choices"));
    } catch (refusal) {
      put("connect-trouble", in_words(refusal));
    }
  }

  #offer(choices) {
    const before = id("scenario").value || "sitl";
    id("scenario").replaceChildren(
      ...Object.entries(choices.scenarios).map(([name, words]) => new Option(`${name}: ${words}`, name)));
    id("scenario").value = before;
    id("robot-file").replaceChildren(
      new Option("the scenario's", ""), ...choices.robots.map((name) => new Option(name, name)));
    this.flasher.choices(choices);
    this.#processors = choices.processors;
    const chosen = id("processor").value || choices.processors[0].name;
    id("processor").replaceChildren(...choices.processors.map(({ name, words }) => new Option(words, name)));
    id("processor").value = chosen;
    this.#processor();
    id("ports").replaceChildren(...choices.ports.map(({ url, what }) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${url}${what ? ` (${what})` : ""}`;
      button.onclick = () => this.#connect(url);
      return button;
    }));
    if (choices.ports.length === 0) id("ports").textContent = "No serial port found.";
  }

  /** Show what the chosen processor needs: a file, or something that is not installed. */
  #processor() {
    const { problem, files } = this.#processors.find(({ name }) => name === id("processor").value);
    id("processor-problem").textContent = problem;
    id("image-label").hidden = files === null;
    id("images").replaceChildren(...(files ?? []).map(({ path }) => new Option(path, path)));
    if (!files?.length || id("image").value) return;
    id("image").value = files[0].path;
    id("robot-file").value = files[0].robot; // what it was built for is at its pins
  }

  async #try(action, content) {
    put("connect-trouble", "Working …");
    try {
      await this.socket.ask(action, content);
      put("connect-trouble", "");
      this.say("");
      this.dialog.close();
    } catch (refusal) {
      put("connect-trouble", in_words(refusal));
    }
  }
}
