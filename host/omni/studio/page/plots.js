// SPDX-License-Identifier: MIT
// Plots over one common time axis. Live, they show the newest seconds; paused, what the mouse has chosen.

import uPlot from "../vendor/uPlot.esm.js";
import { aligned, Buffer, with_gap } from "./buffers.js";
import { look, y_range } from "./curves.js";
import { measured } from "./measure.js";
import { chooseSignals } from "./signals.js";
import { MORE, PART } from "./socket.js";
import { showSpectrum } from "./spectrum.js";
import { axis_style, in_words } from "./words.js";
import { axisFields, XYPlot } from "./xy.js";

const NEAR_PX = 8;
const HEIGHT_PX = 190;
const STORED = "omniwheel-plots";
const NUMBERS = 0x10000;
const LIVE = { stored: STORED, what: "plot", file: "omniwheel", series: (key) => [key], logs: () => 1,
  info: () => undefined, limit: () => undefined };
const FIRST_VIEW = [
  ["tracking.pose.x", "tracking.pose.y", "tracking.reference.x", "tracking.reference.y"],
  ["wheels.speed.1", "wheels.reference.1"],
  ["wheels.duty.1", "wheels.duty.2", "wheels.duty.3"],
];

export class Plots {
  #panels = [];
  #buffers = new Map(); // by key
  #frozen = new Map();
  #shown = []; // keys in the order in which the server numbers them
  #number = 0; // of this list: samples of another one are not for it
  #marks = [];
  #signals = new Map();
  #span = 10;
  #pausedAt = null; // {begin, end}
  #whole = null; // {begin, end} of a recording
  #now = 0;
  #stale = true;
  #arrived = 0;

  /**
   * options: where the view is stored, what a plot is called, the saved file's name; series and info of a key; limit,
   * the value of a limit by its name, undefined if it is not known; logs, how many are shown over each other.
   */
  constructor(root, socket, say, options = {}) {
    this.options = { ...LIVE, ...options };
    this.limit = this.options.limit;
    this.root = root;
    this.socket = socket;
    this.say = say;
    const draw = () => { this.#draw(); requestAnimationFrame(draw); };
    requestAnimationFrame(draw);
    new ResizeObserver(() => this.#panels.forEach((panel) => this.#resize(panel))).observe(root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#rebuild());
    this.drawn = { frames: 0, newest: 0, samples: 0, age_ms: 0 }; // for measurements: what is on the screen
  }

  get paused() { return this.#pausedAt !== null; }
  get keys() { return this.#shown; }
  get marked() { return this.#marks; }
  get newest() { return this.#now; }

  /** What is kept of a signal that is shown: {time, value}. */
  samples_of(key) {
    const { time, value } = this.#buffer(key).between(-Infinity, Infinity);
    return { time: [...time], value: [...value] };
  }

  /** The newest value of a signal that is shown; undefined before the first. */
  latest(key) { return this.#buffer(key).latest; }

  limit_of(key) { return this.#signals.get(key)?.limit; }

  /**
   * view: what is kept of this robot, as view gives it; null: nothing, and what is shown stays. again: the link to it
   * came back, and the plots go on.
   */
  tables(signals, view = null, again = false) {
    this.#signals = new Map(signals.map((signal) => [signal.key, signal]));
    if (!again) this.#begin();
    if (view && !again) this.#show(view);
    else if (this.#panels.length === 0) this.#restore();
    else this.#rebuild();
    this.#subscribe();
  }

  /** Forget the robot before: this one's clock is another. */
  #begin() {
    this.#buffers.clear();
    this.#now = 0;
    this.live();
  }

  /** What is shown, to be kept: {plots: [{keys, xy}], span_s}. */
  get view() {
    return { plots: this.#panels.map(({ keys, xy }) => ({ keys: [...keys], xy })), span_s: this.#span };
  }

  #show({ plots, span_s }) {
    for (const panel of this.#panels) {
      panel.plot?.destroy();
      panel.root.remove();
    }
    const unknown = [...new Set(plots.flatMap(({ keys }) => keys).filter((key) => !this.#signals.has(key)))];
    const known = (keys) => keys.filter((key) => !unknown.includes(key));
    this.#panels = plots.filter(({ keys, xy }) => !xy || known(keys).length === 2)
      .map(({ keys, xy }) => this.#panel(known(keys), xy));
    if (unknown.length) this.say(`Unknown signal ${unknown.join(", ")}: removed from the plots.`);
    this.#span = span_s;
    this.#store();
    this.#rebuild();
  }

  /** Show a recording instead of what is live: the whole of it, until the mouse has chosen a part. */
  recorded(signals, marks, whole) {
    this.#whole = whole;
    this.tables(signals);
    this.marks(marks);
  }

  marks(marks) {
    this.#marks = marks;
    this.#stale = true;
  }

  /** kind: MORE is added, WHOLE replaces what is kept, PART is what a pause shows. number: of the list of signals. */
  samples({ kind, number, traces, arrived }) {
    if (number !== this.#number || (kind === PART && !this.paused)) return; // asked for before, wanted no more
    this.#arrived = arrived;
    for (const { place, time, value } of traces) {
      const key = this.#shown[place];
      if (key === undefined) continue;
      if (kind === PART) this.#frozen.set(key, { time, value });
      else if (kind === MORE) this.#buffer(key).append(time, value);
      else this.#buffer(key).replace(time, value);
      if (time.length) this.#now = Math.max(this.#now, time[time.length - 1]);
      this.drawn.samples += time.length;
    }
    this.#stale = true;
  }

  span(seconds) {
    this.#span = seconds;
    this.live();
    this.#subscribe();
    this.on_view?.(this.view);
  }

  live() {
    this.#pausedAt = null;
    this.#frozen.clear();
    this.#stale = true;
    this.on_pause?.(false);
  }

  pause(begin = this.#now - this.#span, end = this.#now) {
    this.#pausedAt = { begin, end };
    this.on_pause?.(true);
    this.#ask_part();
    this.#stale = true;
  }

  #ask_part() {
    const { begin, end } = this.#pausedAt;
    const width = Math.round(this.root.clientWidth) || 800;
    this.#ask("window", { begin_s: begin, end_s: end, width });
  }

  #ask(action, content) { this.socket.ask(action, content).catch((refusal) => this.say(in_words(refusal))); }

  add(keys = [], xy = false) {
    this.#panels.push(this.#panel(keys, xy));
    this.#changed();
  }

  /** Add a plot of the second signal over the first. */
  addXY() { this.add(this.#choice([]).slice(0, 2).map(({ key }) => key), true); }

  #panel(keys, xy) {
    const panel = { keys: [...keys], xy, root: document.createElement("div"), plot: null };
    panel.root.className = "panel";
    this.root.append(panel.root);
    return panel;
  }

  csv() {
    const { begin, end } = this.#view();
    const pieces = this.#shown.map((key) => this.#piece(key, begin, end));
    const [times, ...columns] = aligned(pieces);
    const heads = this.#shown.map((key) => `${key} [${this.#info(key)?.unit ?? ""}]`);
    const lines = [["time [s]", ...heads].join(",")];
    for (let i = 0; i < times.length; i++) {
      if (times[i] >= begin && times[i] <= end) lines.push([times[i], ...columns.map((c) => c[i] ?? "")].join(","));
    }
    save(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), `${this.options.file}.csv`);
  }

  // ---- signals

  #buffer(key) {
    if (!this.#buffers.has(key)) this.#buffers.set(key, new Buffer());
    return this.#buffers.get(key);
  }

  #info(key) { return this.#signals.get(key) ?? this.options.info(key); }

  /** What a plot can show now. Its other signals wait until they exist. */
  #series({ keys, xy }) {
    const there = keys.filter((key) => this.#signals.get(key)?.absent === false);
    return xy && there.length < 2 ? [] : there.flatMap(this.options.series);
  }

  /** The signals to choose from: those that exist, and those that were chosen before. */
  #choice(keys) { return [...this.#signals.values()].filter(({ key, absent }) => !absent || keys.includes(key)); }

  #restore() {
    let plots = FIRST_VIEW;
    try {
      plots = JSON.parse(localStorage.getItem(this.options.stored)) ?? FIRST_VIEW;
    } catch { /* the first view, then */ }
    this.#show({ plots: plots.map((entry) => (entry.xy ? { keys: entry.xy, xy: true } : { keys: entry, xy: false })),
      span_s: this.#span });
  }

  #store() {
    const plots = this.#panels.map(({ keys, xy }) => (xy ? { xy: keys } : keys));
    try {
      localStorage.setItem(this.options.stored, JSON.stringify(plots));
    } catch { /* the browser keeps nothing: the view is as long as the page */ }
  }

  #changed() {
    this.#store();
    this.#rebuild();
    this.#subscribe();
    this.on_view?.(this.view);
  }

  #subscribe() {
    const wanted = [...new Set(this.#panels.flatMap((panel) => this.#series(panel)))];
    this.#shown = wanted;
    this.#number = (this.#number + 1) % NUMBERS;
    for (const key of this.#buffers.keys()) if (!wanted.includes(key)) this.#buffers.delete(key);
    this.#ask("show", { signals: wanted, number: this.#number, span_s: Math.max(this.#span, 10) });
    if (this.paused) this.#ask_part();
  }

  // ---- drawing

  #view() {
    return this.#pausedAt ?? this.#whole ?? { begin: this.#now - this.#span, end: this.#now };
  }

  #piece(key, begin, end) {
    if (this.#pausedAt && this.#frozen.has(key)) return this.#frozen.get(key);
    return this.#buffer(key).between(begin, end);
  }

  #draw() {
    if (!this.#stale || document.hidden) return;
    this.#stale = false;
    const { begin, end } = this.#view();
    for (const panel of this.#panels) {
      if (panel.plot === null) continue;
      panel.plot.setData(aligned(this.#series(panel).map((key) => with_gap(this.#piece(key, begin, end)))));
    }
    this.drawn.frames += 1;
    this.drawn.newest = this.#now;
    this.drawn.age_ms = performance.timeOrigin + performance.now() - 1000 * this.#arrived;
    this.on_drawn?.();
  }

  #rebuild() {
    for (const panel of this.#panels) this.#build(panel);
    this.#stale = true;
  }

  #build(panel) {
    panel.plot?.destroy();
    panel.plot = null;
    panel.root.replaceChildren(this.#head(panel));
    const keys = this.#series(panel);
    if (keys.length === 0) return;
    const axis = axis_style();
    if (panel.xy) {
      this.#build_xy(panel, keys);
      return;
    }
    const units = [...new Set(keys.map((key) => this.#info(key)?.unit ?? ""))];
    panel.plot = new uPlot({
      width: this.root.clientWidth || 600,
      height: HEIGHT_PX,
      cursor: { sync: { key: this.options.stored }, drag: { x: true, y: false, setScale: false } },
      scales: { x: { time: false, range: () => { const { begin, end } = this.#view(); return [begin, end]; } },
        y: { range: y_range } },
      axes: [{ ...axis, label: "time [s]", labelSize: 16, size: 34 }, { ...axis, label: units.join(", "), size: 62 }],
      series: [{ label: "time [s]", value: (_, t) => (t == null ? "–" : t.toFixed(3)) },
        ...keys.map((key, n) => ({
          label: this.#info(key)?.label ?? key,
          ...look(n, this.options.logs()),
          width: 1, // without a graphics processor, a wider line takes twice as long to draw
          spanGaps: false, // a null, as with_gap makes it; a time without a sample of this signal is no gap
          points: { show: false },
          value: (_, v) => (v == null ? "–" : `${Number(v.toPrecision(5))} ${this.#info(key)?.unit ?? ""}`),
        }))],
      hooks: {
        draw: [(plot) => { this.#draw_limits(panel); this.#draw_marks(plot); }],
        setCursor: [(plot) => this.#near_mark(plot)],
        setSelect: [(plot) => this.#select(plot)],
      },
    }, [[]], panel.root);
    const over = panel.plot.over;
    over.addEventListener("wheel", (event) => this.#wheel(panel.plot, event), { passive: false });
    over.addEventListener("dblclick", () => this.live());
  }

  /** keys: one per log of the first signal, then one per log of the second. */
  #build_xy(panel, keys) {
    const count = keys.length / 2;
    const [x, y] = [keys[0], keys[count]].map((key) => this.#words_of(key));
    const with_unit = ({ label, unit }) => (unit ? `${label} [${unit}]` : label);
    panel.plot = new XYPlot(panel.root, this.root.clientWidth || 600, {
      labels: [with_unit(x), with_unit(y)],
      names: keys.slice(count).map((key) => this.#words_of(key).label),
      colours: keys.slice(count).map((_, n) => look(n, count).stroke),
      alike: x.unit === y.unit,
    });
  }

  #head(panel) {
    const head = document.createElement("div");
    head.className = "head";
    const title = document.createElement("strong");
    title.textContent = panel.keys.map((key) => {
      const { label = key, absent = true } = this.#signals.get(key) ?? {};
      return absent ? `${label} (no data)` : label;
    }).join(", ") || "No signals yet";
    const number = this.#panels.indexOf(panel) + 1;
    const button = (words, name, action) => {
      const found = document.createElement("button");
      found.textContent = words;
      found.setAttribute("aria-label", `${name} ${number}`);
      found.addEventListener("click", action);
      return found;
    };
    const chosen = panel.xy ? axisFields(this.#choice(panel.keys), panel.keys, number, (keys) => {
      panel.keys = keys;
      this.#changed();
    }) : [button("Signals …", `Signals of ${this.options.what}`, async () => {
      const keys = await chooseSignals(this.#choice(panel.keys), panel.keys);
      if (keys === null) return;
      panel.keys = keys;
      this.#changed();
    })];
    head.append(
      title,
      ...chosen,
      ...(panel.xy ? [] : [button("Spectrum", `Spectrum of ${this.options.what}`, () => this.#spectrum(panel))]),
      button("PNG", `Image of ${this.options.what}`, () => panel.plot?.root.querySelector("canvas").toBlob(
        (blob) => save(blob, `${this.options.file}-plot.png`))),
      button("✕", `Remove ${this.options.what}`, () => {
        panel.plot?.destroy();
        panel.root.remove();
        this.#panels.splice(this.#panels.indexOf(panel), 1);
        this.#changed();
      }),
    );
    return head;
  }

  #resize(panel) {
    panel.plot?.setSize({ width: this.root.clientWidth, height: HEIGHT_PX });
    this.#stale = true;
  }

  #draw_marks(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--warn").trim();
    ctx.setLineDash([4, 4]);
    ctx.lineWidth = 1.5;
    for (const mark of this.#marks) {
      const x = plot.valToPos(mark.time_s, "x", true);
      if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  /** A line where a limit of the robot lies, as far as the plot reaches there. */
  #draw_limits(panel) {
    const { ctx, bbox } = panel.plot;
    const names = new Set(panel.keys.map((key) => this.limit_of(key)).filter(Boolean));
    ctx.save();
    ctx.fillStyle = ctx.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--limit").trim();
    ctx.font = `${11 * devicePixelRatio}px system-ui`;
    ctx.lineWidth = devicePixelRatio;
    ctx.textAlign = "left";
    ctx.textBaseline = "bottom";
    ctx.setLineDash([]);
    for (const name of names) {
      for (const sign of [1, -1]) {
        const y = panel.plot.valToPos(sign * this.limit(name), "y", true);
        if (!(y >= bbox.top && y <= bbox.top + bbox.height)) continue;
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
        ctx.fillText(`${sign < 0 ? "−" : ""}${name}`, bbox.left + 4, sign > 0 ? y + 13 * devicePixelRatio : y - 1);
      }
    }
    ctx.restore();
  }

  #words_of(key) {
    const signal = this.#info(key);
    return { label: signal?.label ?? key, unit: signal?.unit ?? "" };
  }

  #spectrum(panel) {
    const signals = this.#series(panel);
    const words = signals.map((key) => this.#words_of(key));
    return showSpectrum(this.socket, {
      signals,
      labels: words.map(({ label }) => label),
      units: words.map(({ unit }) => unit),
      looks: signals.map((_, n) => look(n, this.options.logs())),
      ...this.#view(),
    });
  }

  #near_mark(plot) {
    const near = this.#marks.filter((mark) => Math.abs(plot.valToPos(mark.time_s, "x") - plot.cursor.left) < NEAR_PX);
    this.on_mark?.(near.length ? mark_in_words(near[near.length - 1]) : "");
  }

  /** The plots mark the same stretch together, so all signals are measured. */
  #select(plot) {
    const { left, width } = plot.select;
    if (width < 4) return;
    const [begin, end] = [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")];
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    const keys = new Set(this.#panels.filter(({ xy }) => !xy).flatMap((panel) => this.#series(panel)));
    const pieces = [...keys].map((key) => ({ ...this.#words_of(key), ...this.#piece(key, begin, end) }));
    this.on_measure?.(end - begin, measured(pieces, begin, end));
    this.pause(begin, end);
  }

  #wheel(plot, event) {
    event.preventDefault();
    const { begin, end } = this.#view();
    const at = plot.posToVal(event.offsetX, "x");
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      const step = (end - begin) * 0.1 * Math.sign(event.deltaX || event.deltaY);
      this.pause(begin + step, end + step);
      return;
    }
    const factor = event.deltaY > 0 ? 1.25 : 0.8;
    this.pause(at - (at - begin) * factor, at + (end - at) * factor);
  }
}

function mark_in_words(mark) {
  if (mark.text) return `${mark.before ?? ""}${mark.text}`;
  const changes = Object.entries(mark.changes).map(([name, [from, to]]) => `${name} ${round(from)} → ${round(to)}`);
  return (mark.before ?? "") + (changes.join(", ") || "changed by another program");
}

const round = (value) => Number(value.toPrecision(6));

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
