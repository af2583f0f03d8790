// SPDX-License-Identifier: MIT
// Experiments: choose one, see what it will use, start it, see its result. All names and words come from the server.

import { all_numbers, number_field, number_in } from "./numbers.js";
import { id, in_words, put, show_lines } from "./words.js";

const shown = (number) => (number === null ? "–" : String(Number(number.toPrecision(4))));

export class Experiments {
  #kinds = new Map();
  #fields = new Map(); // by key: returns its value
  #looked = false; // what will be done has been said, and nothing was changed since
  #running = false;
  #ready = false;
  #last = "null";

  #gains = null; // of autotune: {old, new, on_robot}

  /** ask(action, content) sends a request and says a refusal. */
  constructor(socket, ask) {
    this.socket = socket;
    for (const which of ["new", "old"]) {
      id(`keep-${which}`).onclick = () => ask("set", { values: this.#gains[which] });
    }
    id("experiment-kind").onchange = () => this.#choose();
    id("experiment-look").onclick = () => this.#look();
    id("experiment-form").onsubmit = (event) => { event.preventDefault(); this.#start(); };
    id("experiment-form").oninput = () => { this.#looked = false; this.#buttons(); };
  }

  /**
   * kinds: [{name, words, choices}], choices: [{key, label, options} or {key, label, min, max, default}]; default null:
   * it may stay empty.
   */
  tables(kinds = []) {
    this.#kinds = new Map(kinds.map((kind) => [kind.name, kind]));
    id("experiment-kind").replaceChildren(
      ...kinds.map(({ name, words }) => new Option(`${words} (${name})`, name)));
    this.#choose();
  }

  #choose() {
    const kind = this.#kinds.get(id("experiment-kind").value);
    this.#fields.clear();
    id("experiment-choices").replaceChildren(...(kind?.choices ?? []).map((choice) => this.#field(choice)));
    this.#looked = false;
    this.#buttons();
  }

  #field({ key, label, options, min, max, default: usual }) {
    const made = document.createElement("label");
    const field = document.createElement(options ? "select" : "input");
    made.append(`${label} `, field);
    if (options) {
      field.append(...options.map(([, words], place) => new Option(words, place)));
      this.#fields.set(key, () => options[Number(field.value)][0]);
    } else {
      number_field(field, { min, max, optional: usual === null });
      field.value = usual ?? "";
      if (usual === null) field.placeholder = "default";
      this.#fields.set(key, () => number_in(field));
    }
    return made;
  }

  #wanted() {
    const values = [...this.#fields].map(([key, value]) => [key, value()]);
    return { name: id("experiment-kind").value, ...Object.fromEntries(values) };
  }

  async #look() {
    if (!all_numbers(...id("experiment-choices").querySelectorAll("input"))) return;
    try {
      put("experiment-needs", `It ${await this.socket.ask("experiment", this.#wanted())}.`);
      put("experiment-text", "");
      this.#looked = true;
    } catch (refusal) {
      put("experiment-needs", "");
      put("experiment-text", in_words(refusal));
    }
    this.#buttons();
  }

  async #start() {
    this.#looked = false;
    this.#buttons();
    try {
      await this.socket.ask("experiment", { ...this.#wanted(), start: true });
    } catch (refusal) {
      put("experiment-text", in_words(refusal));
    }
  }

  #buttons() {
    id("experiment-look").disabled = !this.#ready || this.#running;
    id("experiment-start").disabled = !this.#ready || this.#running || !this.#looked;
  }

  /** now: the whole state, null without a server */
  state(now) {
    this.#ready = Boolean(now?.robot) && !now.robot.armed && now.link.phase === "connected";
    const run = now?.experiment ?? null;
    this.#running = run?.running ?? false;
    this.#buttons();
    const told = JSON.stringify(run);
    if (!now || told === this.#last) return;
    this.#last = told;
    if (!run) {
      for (const name of ["needs", "text", "seconds"]) put(`experiment-${name}`, "");
      id("experiment-result").hidden = true;
      return;
    }
    put("experiment-needs", run.needs && `It ${run.needs}.`);
    put("experiment-seconds", run.running ? `${run.seconds} s` : "");
    const ended = run.trouble ? `${run.name} ended: ${run.trouble}` : `${run.name} is done: ${run.folder}`;
    put("experiment-text", run.running ? `${run.name}: ${run.phase}` : ended);
    id("experiment-result").hidden = !run.figures;
    if (run.figures) this.#result(run);
  }

  /** Autotune has chosen; the person may choose otherwise, while the robot is disarmed. */
  #choice(gains) {
    this.#gains = gains;
    id("experiment-gains").hidden = !gains;
    if (!gains) return;
    for (const which of ["new", "old"]) {
      id(`keep-${which}`).setAttribute("aria-pressed", String(gains.on_robot === which));
      id(`keep-${which}`).disabled = gains.on_robot === which;
    }
    put("experiment-gains-text", gains.on_robot
      ? `The robot has the ${gains.on_robot} values. Store on robot, under Parameters, keeps them over a power cut.`
      : "The robot has neither the old nor the new values: something was changed since.");
  }

  #result({ number, name, figures, remarks, picture, gains }) {
    id("experiment-caption").textContent = name;
    id("experiment-figures").replaceChildren(...figures.map((figure) => {
      const row = document.createElement("tr");
      const head = document.createElement("th");
      head.scope = "row";
      head.textContent = figure.unit ? `${figure.name} [${figure.unit}]` : figure.name;
      row.append(head, ...[figure.measured, figure.half_width, figure.model].map((value) => {
        const cell = document.createElement("td");
        cell.textContent = shown(value);
        return cell;
      }));
      return row;
    }));
    show_lines(id("experiment-remarks"), remarks);
    this.#choice(gains);
    id("experiment-picture").hidden = !picture;
    if (!picture) return;
    const token = encodeURIComponent(this.socket.token);
    id("experiment-picture").src = `experiment.png?token=${token}&number=${number}`;
  }
}
