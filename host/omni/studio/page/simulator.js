// SPDX-License-Identifier: MIT
// What can be broken in the simulated world, and how fast it runs. All names and words come from the server.

import { id, put } from "./words.js";

const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};
const key_of = (fault, wheel) => `${fault} ${wheel ?? ""}`;

export class Simulator {
  #buttons = new Map(); // by fault and wheel: {button, words}

  /** ask(action, content) sends a request and says a refusal. */
  constructor(section, ask) {
    this.section = section;
    this.ask = ask;
    id("mend").onclick = () => ask("world", { mend: true });
    id("world-speed").onchange = (event) => ask("world", { speed: Number(event.target.value) });
  }

  /** catalogue: {faults: [{name, group, words, reaction, wheels}], speeds}; null: the robot is not simulated here */
  tables(catalogue) {
    this.#buttons.clear();
    const groups = new Map();
    for (const fault of catalogue?.faults ?? []) {
      const { group } = fault;
      if (!groups.has(group)) groups.set(group, element("div", {}, element("h3", { textContent: group })));
      groups.get(group).append(this.#row(fault));
    }
    id("world-faults").replaceChildren(...groups.values());
    id("world-speed").replaceChildren(
      ...(catalogue?.speeds ?? []).map(
        (speed) => new Option(speed === 1 ? "real time" : `${speed} × real time`, speed)));
  }

  #row({ name, words, reaction, wheels }) {
    const buttons = (wheels.length ? wheels : [null]).map((wheel) => {
      const button = element("button", { textContent: wheel === null ? "Break" : `Wheel ${wheel}` });
      const all = wheel === null ? words : `${words}, wheel ${wheel}`;
      button.setAttribute("aria-label", `${button.textContent}: ${words}`);
      button.setAttribute("aria-pressed", "false");
      button.dataset.fault = key_of(name, wheel);
      button.onclick = () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        this.ask("world", wheel === null ? { fault: name, on } : { fault: name, wheel, on });
      };
      this.#buttons.set(key_of(name, wheel), { button, words: all });
      return button;
    });
    return element("div", { className: "breakable" },
      element("div", { textContent: words }), element("div", { className: "hint", textContent: reaction }),
      element("div", { className: "bar" }, ...buttons));
  }

  /** now: {on: [{fault, wheel}], speed, refusal}; null: the robot is not simulated here */
  state(now) {
    this.section.hidden = now === null;
    if (!now?.on) return;
    const on = new Set(now.on.map(({ fault, wheel }) => key_of(fault, wheel)));
    for (const [key, { button }] of this.#buttons) button.setAttribute("aria-pressed", String(on.has(key)));
    const broken = [...on].map((key) => this.#buttons.get(key)?.words ?? key);
    id("mend").disabled = on.size === 0;
    const text = now.refusal || (broken.length ? `Active faults: ${broken.join("; ")}` : "No active faults.");
    put("world-text", text);
    if (document.activeElement !== id("world-speed")) id("world-speed").value = String(now.speed);
  }
}
