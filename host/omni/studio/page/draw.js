// SPDX-License-Identifier: MIT
// A path drawn on the map: what the robot would follow is asked of the server, and shown before it is driven.

import { all_numbers, number_in } from "./numbers.js";
import { id, put } from "./words.js";

export class DrawnPath {
  /** on: {armed, whether the robot may move; it says why not; begin(action, content), to follow a path} */
  constructor(map, ask, { armed, begin }) {
    this.map = map;
    this.ask = ask; // (action, content) => result, undefined if it was refused; the refusal is shown
    id("draw").onclick = () => this.#draw(!map.drawing);
    id("follow-line").onclick = () => {
      if (!armed() || !this.#numbers()) return;
      begin("follow_line", this.#request());
    };
    id("forget-line").onclick = () => this.#forget();
    for (const name of ["draw-speed", "draw-heading", "laps"]) {
      id(name).addEventListener("change", () => this.#preview());
    }
  }

  /** The mouse has drawn a line. */
  drawn() {
    this.#draw(false);
    return this.#preview();
  }

  #draw(on) {
    this.map.drawing = on;
    id("draw").setAttribute("aria-pressed", on);
    if (on) put("draw-text", "press on the map and draw");
  }

  #numbers() { return all_numbers(id("draw-speed"), id("laps")); }

  #request() {
    return {
      line: this.map.line,
      speed: number_in(id("draw-speed")),
      laps: number_in(id("laps")),
      heading: id("draw-heading").value === "keep" ? this.map.heading : null,
    };
  }

  async #preview() {
    if (this.map.line.length < 2) return;
    id("follow-line").disabled = true; // until what it would do is known
    if (!this.#numbers()) return;
    const found = await this.ask("preview_path", this.#request());
    if (this.map.line.length < 2) return; // it was forgotten meanwhile
    this.map.planned(found?.line ?? []);
    id("follow-line").disabled = !found;
    id("forget-line").disabled = false;
    put("draw-text", found ? plan_in_words(found) : "");
  }

  #forget() {
    this.#draw(false);
    this.map.planned(null);
    id("follow-line").disabled = id("forget-line").disabled = true;
    put("draw-text", "");
  }
}

function plan_in_words({ length_m, duration_s, way_s, slowed }) {
  const way = way_s > 0 ? `, and ${way_s.toFixed(1)} s to its start` : "";
  const time = (duration_s === null ? "endless" : `${duration_s.toFixed(1)} s`) + way;
  const slower = slowed > 1.01 ? `, ${slowed.toFixed(1)} times slower than requested, by the robot's limits` : "";
  return `${length_m.toFixed(2)} m, ${time}${slower}`;
}
