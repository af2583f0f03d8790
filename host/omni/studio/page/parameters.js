// SPDX-License-Identifier: MIT
// The list of parameters: search, field, slider, marks for what was changed, and a refusal beside its field.

import { number_field, parse_number } from "./numbers.js";
import { in_words } from "./words.js";

const SLIDER_STEPS = 1000;
const DRAG_EVERY_MS = 60;

export class ParameterList {
  #entries = new Map(); // name → {info, row, field, slider, refusal, value, start}
  #armed = false;
  #step = 0;

  constructor(root, socket) {
    this.root = root;
    this.socket = socket;
    this.search = "";
    this.onlyChanged = false;
  }

  /** again: the link came back; what each value was at the start is still known. */
  tables(infos, again = false) {
    const starts = new Map([...this.#entries].map(([name, { start }]) => [name, again ? start : undefined]));
    this.#entries.clear();
    const open = new Set([...this.root.querySelectorAll("details[open] > summary")].map((title) => title.textContent));
    const groups = Map.groupBy(infos, (info) => info.group);
    this.root.replaceChildren(...[...groups].map(([name, members]) => {
      const group = document.createElement("details");
      const title = document.createElement("summary");
      title.textContent = name;
      group.open = open.has(name);
      group.append(title, ...members.map((info) => this.#row(info, starts.get(info.name))));
      return group;
    }));
  }

  /** What the robot uses; undefined for a name that it does not know. */
  value_of(name) { return this.#entries.get(name)?.value; }

  values(values) {
    for (const [name, value] of Object.entries(values)) {
      const entry = this.#entries.get(name);
      if (!entry) continue;
      entry.start ??= value;
      entry.value = value;
      this.#show(entry);
    }
    this.filter();
  }

  armed(armed) {
    if (armed === this.#armed) return;
    this.#armed = armed;
    for (const entry of this.#entries.values()) this.#lock(entry);
  }

  filter() {
    const words = this.search.toLowerCase().split(/\s+/).filter(Boolean);
    const searching = words.length > 0 || this.onlyChanged;
    for (const { info, row, value, start } of this.#entries.values()) {
      const fits = words.every((word) => `${info.name} ${info.doc}`.toLowerCase().includes(word));
      const changed = value !== info.default || value !== start;
      row.hidden = !(fits && (changed || !this.onlyChanged));
    }
    for (const group of this.root.querySelectorAll("details")) {
      const any = [...group.querySelectorAll(".parameter")].some((row) => !row.hidden);
      group.hidden = !any;
      if (searching) group.open = any;
    }
  }

  #row(info, start) {
    const row = document.createElement("div");
    row.className = "parameter";
    row.dataset.name = info.name;
    const head = document.createElement("div");
    const name = document.createElement("label");
    name.className = "name";
    name.textContent = info.name;
    name.htmlFor = `field-${info.name}`;
    const tags = document.createElement("span");
    head.append(name, tags);
    const line = document.createElement("div");
    line.className = "row";
    const doc = document.createElement("div");
    doc.className = "doc";
    doc.textContent = `${info.doc}${range_in_words(info)}`;
    const refusal = document.createElement("p");
    refusal.className = "refusal";
    refusal.setAttribute("role", "alert");
    const entry = { info, row, tags, refusal, slider: null, value: undefined, start };
    entry.field = this.#field(entry);
    line.append(entry.field);
    if (info.unit) line.append(info.unit);
    if (info.kind === "real") line.append((entry.slider = this.#slider(entry)));
    row.append(head, line, doc, refusal);
    this.#entries.set(info.name, entry);
    return row;
  }

  #field(entry) {
    const { info } = entry;
    let field;
    if (info.kind === "enum" || info.kind === "bool") {
      field = document.createElement("select");
      const values = info.kind === "bool" ? { off: 0, on: 1 } : info.values;
      for (const [name, number] of Object.entries(values)) field.add(new Option(name, number));
    } else {
      field = number_field(document.createElement("input"), { whole: info.kind === "int" });
      field.dataset.ownProblem = "";
    }
    field.id = `field-${info.name}`;
    field.addEventListener("change", () => this.#enter(entry));
    field.addEventListener("blur", () => this.#show(entry)); // what was refused, or only half typed, goes
    return field;
  }

  #slider(entry) {
    const slider = document.createElement("input");
    slider.type = "range";
    slider.min = 0;
    slider.max = SLIDER_STEPS;
    slider.setAttribute("aria-label", `${entry.info.name}, slider`);
    let last = 0;
    let step = 0;
    const send = (value) => { entry.field.value = value; this.#set(entry, value, step); };
    slider.addEventListener("input", () => {
      if (step === 0) step = ++this.#step; // one undo step for a whole drag
      if (performance.now() - last < DRAG_EVERY_MS) return;
      last = performance.now();
      send(from_slider(entry.info, Number(slider.value), entry.start));
    });
    slider.addEventListener("change", () => {
      if (step === 0) step = ++this.#step;
      send(from_slider(entry.info, Number(slider.value), entry.start));
      step = 0;
    });
    return slider;
  }

  /** What was typed is set on the robot, or refused beside the field. */
  #enter(entry) {
    const { value, problem } = parse_number(entry.field.value, { whole: entry.info.kind === "int" });
    if (problem) entry.refusal.textContent = `${problem} The robot keeps ${entry.value}.`;
    else this.#set(entry, value, ++this.#step);
  }

  async #set(entry, value, step) {
    try {
      await this.socket.ask("set", { values: { [entry.info.name]: value }, step });
      entry.refusal.textContent = "";
    } catch (refusal) {
      entry.refusal.textContent = in_words(refusal);
      this.#show(entry);
    }
  }

  #show(entry) {
    const { info, field, slider, tags, value, start } = entry;
    if (value === undefined) return;
    if (document.activeElement !== field || field.tagName === "SELECT") field.value = value; // not being edited
    if (slider && !slider.matches(":active")) slider.value = to_slider(info, value, start);
    tags.replaceChildren();
    const tag = (words, kind, title) => {
      const found = document.createElement("span");
      found.className = `tag ${kind}`;
      found.textContent = words;
      found.title = title;
      tags.append(found);
    };
    if (value !== info.default) tag("not default", "default", `default: ${info.default}`);
    if (value !== start) tag(`was ${start}`, "start", "changed since this page connected");
    this.#lock(entry);
  }

  #lock({ info, field, slider }) {
    const locked = info.disarmed_only && this.#armed;
    field.disabled = locked;
    field.title = locked ? "only while disarmed" : "";
    if (slider) slider.disabled = locked;
  }
}

function range_in_words({ kind, min, max, unit, disarmed_only }) {
  const range = kind === "real" || kind === "int" ? `; ${min} to ${max}${unit ? ` ${unit}` : ""}` : "";
  return `${range}${disarmed_only ? "; only while disarmed" : ""}`;
}

// A slider covers a factor of 10 up and down from the value at the start; from 0, a hundredth of the range.
function bounds({ min, max }, start) {
  const size = Math.abs(start) || (max - min) / 100;
  return start > 0 ? [Math.max(min, size / 10), Math.min(max, size * 10), true]
    : [Math.max(min, -size), Math.min(max, size), false];
}

function to_slider(info, value, start) {
  const [low, high, log] = bounds(info, start);
  const part = log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.round(SLIDER_STEPS * Math.min(1, Math.max(0, Number.isFinite(part) ? part : 0)));
}

function from_slider(info, place, start) {
  const [low, high, log] = bounds(info, start);
  const part = place / SLIDER_STEPS;
  const value = log ? low * (high / low) ** part : low + (high - low) * part;
  return Number(Math.min(high, Math.max(low, value)).toPrecision(4));
}
