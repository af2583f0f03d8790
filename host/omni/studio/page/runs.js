// SPDX-License-Identifier: MIT
// Earlier drives: their list, their plots, two of them beside each other; and the recording of the next one.

import { Plots } from "./plots.js";
import { PART, unpacked, WHOLE } from "./socket.js";
import { id, in_words, put } from "./words.js";

const LETTERS = ["A", "B"];
const SEARCH_MS = 250;
const EVERYTHING = { begin_s: -Number.MAX_SAFE_INTEGER, end_s: Number.MAX_SAFE_INTEGER, width: 2000 };
const BETWEEN = "|"; // a series is the number of a log and a signal's key

export class Runs {
  #open = []; // [{log, title, run, about}], one or two
  #infos = new Map();
  #later = [0]; // by how much each log is shown earlier than its own clock [s]
  #busy = false;
  #next = {}; // what is asked for next, by kind
  #shown = { signals: [], number: 0 }; // what the plots want to show
  #recording = null;

  constructor(socket, say) {
    this.socket = socket;
    this.say = say;
    this.plots = new Plots(id("run-panels"), { ask: (action, content) => this.#samples(action, content) }, say, {
      stored: "omniwheel-run-plots", what: "run plot", file: "omniwheel-run",
      limit: (name) => this.#limit(name),
      series: (key) => this.#open.map((_, n) => `${n}${BETWEEN}${key}`),
      info: (key) => this.#info(key),
      logs: () => this.#open.length,
    });
    this.plots.on_pause = (paused) => { id("run-whole").disabled = !paused; };
    this.plots.on_mark = (words) => { put("run-mark-text", words); };
    this.plots.on_measure = (seconds, lines) => {
      const chosen = `${seconds.toPrecision(4)} s selected; double-click to show the whole run`;
      put("run-mark-text", [chosen, ...lines].join(". "));
    };
    let timer = 0;
    id("run-search").oninput = () => { clearTimeout(timer); timer = setTimeout(() => this.refresh(), SEARCH_MS); };
    id("run-refresh").onclick = () => this.refresh();
    id("run-file").onchange = (event) => this.#upload(event.target);
    id("run-add-plot").onclick = () => this.plots.add();
    id("run-add-xy").onclick = () => this.plots.addXY();
    id("run-align").onchange = () => this.#show(this.#open, false);
    id("run-whole").onclick = () => this.plots.live();
    id("run-csv").onclick = () => this.plots.csv();
    id("run-close").onclick = () => this.#show([]);
    id("record").onclick = () => this.#try(() => socket.ask("record", { on: !this.#recording?.on }));
  }

  /** The logs that are shown: one, or two that are compared. */
  get shown() { return this.#open.map(({ log }) => log); }

  /** Show whether a recording runs; connected: whether there is a robot to record. */
  recording(now, connected) {
    const before = this.#recording;
    const changed = before && now && (before.on !== now.on || before.completed !== now.completed);
    this.#recording = now ?? null;
    const words = now?.on ? `on: ${now.folder}` : now?.trouble ? `off: ${now.trouble}` : "off";
    put("fact-recording", words);
    id("fact-recording").className = now?.on ? "on" : now?.trouble ? "bad" : "";
    id("record").setAttribute("aria-pressed", Boolean(now?.on));
    id("record").disabled = !now?.on && !connected;
    if (changed) this.refresh();
  }

  async refresh() {
    await this.#try(async () => {
      const found = await this.socket.ask("runs", { find: id("run-search").value });
      this.largest = found.largest_upload;
      const more = found.more ? `, and ${found.more} older ones: use the search` : "";
      put("run-hint", `${found.runs.length} in ${found.folder}${more}. `
        + `A log of up to ${Math.round(found.largest_upload / 2 ** 20)} MB from outside this folder can be opened.`);
      const rows = found.runs.map((run) => this.#row(run));
      const heads = ["Name", "When", "Robot", "What", "Figures", "Show"];
      id("run-list").replaceChildren(...(rows.length ? [table(heads, rows)] : []));
    });
  }

  #row(run) {
    const log = `run:${run.name}`;
    const what = [run.asked, run.end === "done" ? "" : run.end].filter(Boolean).join("; ");
    const show = document.createElement("td");
    const button = (words, action) => {
      const found = document.createElement("button");
      found.textContent = words;
      found.setAttribute("aria-label", `${words} ${run.name}`);
      found.disabled = !run.has_log;
      if (!run.has_log) found.title = "It has neither a telemetry log nor a record.";
      found.onclick = action;
      show.append(found, " ");
    };
    button("Open", () => this.#add([], { log, title: run.name, run: run.name }));
    button("Compare", () => this.#add(this.#open.slice(0, 1), { log, title: run.name, run: run.name }));
    return [...[run.name, when(run.when), run.robot, what, run.figures].map(cell), show];
  }

  async #add(before, { log, title, run }) {
    put("run-text", `Reading ${title} …`);
    const about = await this.#try(() => this.socket.ask("open_run", { log }));
    put("run-text", "");
    if (!about) return;
    this.#show([...before, { log, title, run, about }]);
    if (about.lost_bytes || about.bad_frames) {
      const what = `${about.lost_bytes} bytes and ${about.bad_frames} messages are unreadable`;
      this.say(`${title} is damaged: ${what}. The rest is shown.`);
    }
    await this.#compare();
    id("run-view").scrollIntoView({ block: "nearest" });
  }

  #show(logs, anew = true) {
    this.#open = logs;
    id("run-view").hidden = logs.length === 0;
    if (anew) id("run-compared").replaceChildren();
    put("run-mark-text", "");
    if (logs.length === 0) return;
    const letter = (n) => (logs.length > 1 ? `${LETTERS[n]}: ` : "");
    id("run-name").textContent = logs.map(({ title }, n) => letter(n) + title).join(", ");
    const signals = new Map();
    for (const signal of logs.flatMap(({ about }) => about.signals)) { // absent: from every log
      if (!signal.absent || !signals.has(signal.key)) signals.set(signal.key, signal);
    }
    this.#infos = signals;
    const known = logs.length > 1 && logs.every(({ about }) => about.path_s !== null);
    id("run-align-label").hidden = !known;
    const aligned = known && id("run-align").checked;
    this.#later = logs.map(({ about }) => (aligned ? about.path_s - logs[0].about.path_s : 0));
    const marks = logs.flatMap(({ about }, n) => about.marks.map(
      (mark) => ({ ...mark, time_s: mark.time_s - this.#later[n], before: letter(n) })));
    const end = Math.max(...logs.map(({ about }, n) => about.duration_s - this.#later[n]), 1e-3);
    this.plots.recorded([...signals.values()], marks, { begin: Math.min(0, ...this.#later.map((s) => -s)), end });
  }

  #info(key) {
    const [number, signal] = key.split(BETWEEN);
    const found = this.#infos.get(signal);
    return found && this.#open.length > 1 ? { ...found, label: `${LETTERS[number]}: ${found.label}` } : found;
  }

  /** The value of a limit, if all logs that are shown have the same. */
  #limit(name) {
    const values = new Set(this.#open.map(({ about }) => about.limits[name]));
    return values.size === 1 ? [...values][0] : undefined;
  }

  async #compare() {
    const logs = this.#open;
    if (logs.length < 2) return;
    const names = logs.map(({ run }) => run);
    if (names.some((name) => !name)) return; // a log from elsewhere has neither figures nor parameters
    const found = await this.#try(() => this.socket.ask("compare_runs", { one: names[0], other: names[1] }));
    if (!found || logs !== this.#open) return; // other ones are shown by now
    const rows = (lines) => lines.map((line) => line.map(cell));
    const parameters = found.parameters.length ? [table(["Parameter", "A", "B"], rows(found.parameters))]
      : ["No common parameter differs."];
    id("run-compared").replaceChildren(table(["Figure", "A", "B"], rows(found.numbers)), ...parameters);
  }

  async #upload(field) {
    const [file] = field.files;
    if (!file) return;
    await this.#try(async () => {
      const most = Math.round(this.largest / 2 ** 20);
      if (file.size > this.largest) throw { error: `${file.name} is larger than ${most} MB` };
      put("run-text", `Reading ${file.name} …`);
      const { log } = await (await this.#post("run-log", file)).json();
      await this.#add([], { log, title: file.name, run: "" });
    });
    field.value = "";
  }

  /** What the plots ask for, as of a live robot. Only the newest request is done: the wheel makes many. */
  async #samples(action, content) {
    if (action === "spectrum") return this.#spectra(content);
    if (action === "show") this.#shown = content;
    this.#next[action] = action === "show" ? EVERYTHING : content;
    if (this.#busy) return;
    this.#busy = true;
    try {
      for (let kind; (kind = Object.keys(this.#next).sort()[0]);) { // the whole before a part of it
        const { begin_s, end_s, width } = this.#next[kind];
        delete this.#next[kind];
        await this.#fetch(this.#shown, { begin_s, end_s, width }, kind === "window" ? PART : WHOLE);
      }
    } finally {
      this.#busy = false;
    }
  }

  async #spectra({ signals, begin_s, end_s }) {
    const found = new Map();
    for (const [n, { log }] of this.#open.entries()) {
      const mine = signals.filter((key) => key.startsWith(`${n}${BETWEEN}`)).map((key) => key.split(BETWEEN)[1]);
      if (mine.length === 0) continue;
      const range = { begin_s: begin_s + this.#later[n], end_s: end_s + this.#later[n] };
      for (const one of await this.socket.ask("run_spectrum", { log, signals: mine, ...range })) {
        found.set(`${n}${BETWEEN}${one.key}`, { ...one, key: `${n}${BETWEEN}${one.key}` });
      }
    }
    return signals.map((key) => found.get(key)).filter(Boolean);
  }

  async #fetch(shown, range, kind) {
    const [logs, later] = [this.#open, this.#later];
    const traces = await Promise.all(logs.map(async ({ log }, n) => {
      const mine = shown.signals.map((key, place) => ({ key, place }))
        .filter(({ key }) => key.startsWith(`${n}${BETWEEN}`));
      if (mine.length === 0) return [];
      const signals = mine.map(({ key }) => key.split(BETWEEN)[1]);
      const { begin_s, end_s, width } = range;
      const wanted = { log, signals, begin_s: begin_s + later[n], end_s: end_s + later[n], width };
      const answer = await this.#post("run-samples", JSON.stringify(wanted));
      const found = unpacked(await answer.arrayBuffer());
      return found.traces.map(({ place, time, value }) => (
        { place: mine[place].place, time: time.map((t) => t - later[n]), value }));
    }));
    if (logs !== this.#open || later !== this.#later) return; // wanted no more
    this.plots.samples({ kind, number: shown.number, traces: traces.flat(), arrived: 0 });
  }

  async #post(where, body) {
    let answer;
    try {
      answer = await fetch(`${where}?token=${encodeURIComponent(this.socket.token)}`, { method: "POST", body });
    } catch {
      throw { error: "the studio's server does not respond", hint: "" };
    }
    if (!answer.ok) throw await answer.json().catch(() => ({ error: `HTTP status ${answer.status}` }));
    return answer;
  }

  async #try(action) {
    try {
      const result = await action();
      return result;
    } catch (refusal) {
      if (!refusal.error) throw refusal;
      put("run-text", "");
      this.say(in_words(refusal));
      return undefined;
    }
  }
}

function when(text) {
  const time = new Date(text);
  return Number.isNaN(time.getTime()) ? "" : time.toLocaleString();
}

function cell(words) {
  const found = document.createElement("td");
  found.textContent = words;
  return found;
}

function table(heads, rows) {
  const found = document.createElement("table");
  const head = found.createTHead().insertRow();
  for (const words of heads) {
    const th = document.createElement("th");
    th.scope = "col";
    th.textContent = words;
    head.append(th);
  }
  const body = found.createTBody();
  for (const cells of rows) body.insertRow().append(...cells);
  return found;
}
