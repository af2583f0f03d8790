// SPDX-License-Identifier: MIT
// Bring-up: what is said and asked, the wheel that is meant, what was found. All words come from the server.

import { id, in_words, put, show_lines } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";
const ANSWERS = {
  confirm: [["Yes, continue", true], ["No", false]],
  saw: [["Yes", true], ["No", false], ["I do not know", null]],
};

export class BringUp {
  #told = "";
  #asked = 0;
  #hand = "";

  /** ask(action, content) sends a request and says a refusal. */
  constructor(socket, ask) {
    this.socket = socket;
    this.ask = ask;
    id("bring-up-cancel").onclick = () => ask("disarm");
    id("bring-up-form").onsubmit = (event) => {
      event.preventDefault();
      const robot = id("bring-up-robot").value || null;
      this.#ask({ start: true, check: id("bring-up-check").value, robot });
    };
    id("bring-up-robot").onchange = () => this.#wiring();
    id("wiring").ontoggle = () => this.#wiring();
  }

  /** catalogue: {checks: [[name, words]], robots, robot}; wheels: their bearings in the robot [rad] */
  tables({ checks, robots, robot }, wheels = []) {
    id("bring-up-check").replaceChildren(...checks.map(([name, words]) => new Option(words, name)));
    id("bring-up-robot").replaceChildren(new Option("none", ""), ...robots.map((name) => new Option(name, name)));
    id("bring-up-robot").value = robot ?? "";
    this.#draw(wheels);
    this.#wiring();
  }

  /** The robot from above, its front up: x is up, y to the left. */
  #draw(wheels) {
    const made = (tag, attributes, ...children) => {
      const found = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
      found.append(...children);
      return found;
    };
    const at = (bearing, radius, along = 0) => [
      -radius * Math.sin(bearing) - along * Math.cos(bearing), -radius * Math.cos(bearing) + along * Math.sin(bearing)];
    id("bring-up-drawing").replaceChildren(
      made("circle", { r: 1 }), made("path", { d: "M0 .25 V-.5 M-.12 -.35 L0 -.5 L.12 -.35" }),
      made("text", { x: 0, y: -0.72 }, "front"),
      ...wheels.map((bearing, wheel) => {
        const [[x1, y1], [x2, y2], [x, y]] = [at(bearing, 1, -0.28), at(bearing, 1, 0.28), at(bearing, 1.35)];
        return made("g", { "data-wheel": wheel + 1 }, made("line", { x1, y1, x2, y2, class: "wheel" }),
          made("text", { x, y }, String(wheel + 1)));
      }));
  }

  #wiring() {
    const robot = id("bring-up-robot").value;
    id("wiring").hidden = !robot;
    if (!robot || !id("wiring").open) return;
    const token = encodeURIComponent(this.socket.token);
    id("wiring-picture").src = `wiring.svg?robot=${encodeURIComponent(robot)}&token=${token}`;
  }

  async #ask(content) {
    try {
      await this.socket.ask("bring_up", content);
    } catch (refusal) {
      put("bring-up-state", in_words(refusal));
    }
  }

  /** now: the whole state, null without a server */
  state(now) {
    const walk = now?.bring_up ?? null;
    const ready = Boolean(now?.robot) && !now.robot.armed && now.link.phase === "connected";
    id("bring-up-start").disabled = !ready || (walk?.running ?? false);
    id("bring-up-cancel").disabled = !walk?.running;
    this.#hands(walk?.hand ?? null, now?.world?.on ?? []);
    const told = JSON.stringify(walk);
    if (walk === null || told === this.#told) return;
    this.#told = told;
    const passed = walk.results.filter(({ ok }) => ok).length;
    const done = walk.results.length ? `${passed} of ${walk.results.length} passed. ${walk.folder}` : "";
    put("bring-up-state", walk.running ? "running" : [walk.trouble, done].filter(Boolean).join(" "));
    show_lines(id("bring-up-lines"), walk.lines);
    for (const group of id("bring-up-drawing").querySelectorAll("g")) {
      group.classList.toggle("meant", Number(group.dataset.wheel) === walk.wheel);
    }
    id("bring-up-drawing").setAttribute("aria-label",
      walk.wheel ? `This robot from above; wheel ${walk.wheel} is highlighted` : "This robot from above");
    this.#question(walk.question);
    id("bring-up-results").replaceChildren(...walk.results.map((result) => this.#result(result)));
  }

  /** What moves the simulated robot in place of a hand: a text, and buttons that switch something in its world. */
  #hands(hand, on) {
    const told = JSON.stringify(hand);
    if (told !== this.#hand) { // the focus stays on a button
      this.#hand = told;
      put("bring-up-hand", hand?.text ?? "");
      id("bring-up-hands").replaceChildren(...(hand?.buttons ?? []).map(({ words, fault }) => {
        const button = document.createElement("button");
        button.textContent = words;
        button.onclick = () => this.ask("world", fault);
        return button;
      }));
    }
    hand?.buttons.forEach(({ fault }, place) => { // a second turn on top of the first would be too much
      const is_on = on.some((one) => one.fault === fault.fault && one.wheel === (fault.wheel ?? null));
      id("bring-up-hands").children[place].disabled = is_on === fault.on;
    });
  }

  #question(question) {
    put("bring-up-question", question?.text ?? "");
    if ((question?.number ?? 0) === this.#asked) return; // the focus stays on its buttons
    this.#asked = question?.number ?? 0;
    id("bring-up-answers").replaceChildren(...(question ? ANSWERS[question.kind] : []).map(([words, yes]) => {
      const button = document.createElement("button");
      button.textContent = words;
      button.onclick = () => this.#ask({ number: question.number, yes });
      return button;
    }));
  }

  #result({ check, ok, findings }) {
    const table = document.createElement("table");
    table.createCaption().textContent = `${check}: ${ok ? "pass" : "fail"}`;
    for (const finding of findings) {
      const row = table.insertRow();
      const seen = [finding.seen, finding.advice].filter(Boolean).join(" → ");
      for (const words of [finding.ok ? "✓" : "✗", finding.name, seen]) {
        row.insertCell().textContent = words;
      }
    }
    return table;
  }
}
