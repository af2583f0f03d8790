// SPDX-License-Identifier: MIT
// One signal over another instead of over the time. It takes the same columns as a plot over the time.

import uPlot from "../vendor/uPlot.esm.js";
import { axis_style } from "./words.js";

const HEIGHT_PX = 320;
const MARGIN = 0.05;

const in_words = (_, splits) => splits.map((value) => String(Number(value.toPrecision(6))));

/** Ranges of both axes that hold all points; as many pixels per unit on both if they have the same unit. */
function ranges(points, width, height, alike) {
  const ends = [[Infinity, -Infinity], [Infinity, -Infinity]];
  for (const { x, y } of points) {
    for (const [axis, values] of [x, y].entries()) {
      for (const value of values) {
        if (value === null) continue;
        ends[axis][0] = Math.min(ends[axis][0], value);
        ends[axis][1] = Math.max(ends[axis][1], value);
      }
    }
  }
  const middle = ends.map(([low, high]) => (Number.isFinite(low) ? (low + high) / 2 : 0));
  const half = ends.map(([low, high]) => ((Number.isFinite(low) && high - low) || 1) * (0.5 + MARGIN));
  if (alike) {
    const unit_px = Math.min(width / half[0], height / half[1]);
    half[0] = width / unit_px;
    half[1] = height / unit_px;
  }
  return middle.map((centre, axis) => [centre - half[axis], centre + half[axis]]);
}

/** Points of two columns over the same times: its last sample holds where one has none; null at a gap. */
export function paired(x, y) {
  const found = { x: [], y: [] };
  let [last_x, last_y] = [null, null];
  for (let i = 0; i < x.length; i++) {
    if (x[i] === null || y[i] === null) {
      if (last_x !== null && last_y !== null) {
        found.x.push(null);
        found.y.push(null);
      }
      [last_x, last_y] = [null, null];
      continue;
    }
    last_x = x[i] ?? last_x;
    last_y = y[i] ?? last_y;
    if (last_x === null || last_y === null) continue;
    found.x.push(last_x);
    found.y.push(last_y);
  }
  return found;
}

export class XYPlot {
  #plot;
  #ranges = [[-1, 1], [-1, 1]];

  /** labels: of both axes, with units; names: of the curves, one per pair of columns; alike: the same unit on both */
  constructor(root, width, { labels, names, colours, alike }) {
    const axis = { ...axis_style(), values: in_words };
    this.alike = alike;
    this.count = names.length;
    this.#plot = new uPlot({
      mode: 2,
      width,
      height: HEIGHT_PX,
      cursor: { drag: { x: false, y: false } },
      legend: { show: names.length > 1, live: false },
      scales: { x: { time: false, range: () => this.#ranges[0] }, y: { range: () => this.#ranges[1] } },
      axes: [{ ...axis, label: labels[0], labelSize: 16, size: 34 }, { ...axis, label: labels[1], size: 62 }],
      series: [{}, ...names.map((label, n) => ({
        label,
        stroke: colours[n],
        facets: [{ scale: "x", auto: false }, { scale: "y", auto: false }],
        paths: (plot, number) => this.#draw(plot, number, colours[n]),
      }))],
    }, [null, ...names.map(() => [[], []])], root);
  }

  get root() { return this.#plot.root; }
  get over() { return this.#plot.over; }

  /** columns: times, then all x, then all y */
  setData(columns) {
    const given = columns.slice(1);
    const points = names(this.count).map((n) => paired(given[n] ?? [], given[this.count + n] ?? []));
    const { width, height } = this.#plot.bbox;
    this.#ranges = ranges(points, width || 1, height || 1, this.alike);
    this.#plot.setData([null, ...points.map(({ x, y }) => [x, y])]);
  }

  setSize({ width }) { this.#plot.setSize({ width, height: HEIGHT_PX }); }

  destroy() { this.#plot.destroy(); }

  #draw(plot, number, colour) {
    const { ctx, bbox } = plot;
    const [xs, ys] = plot.data[number];
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.beginPath();
    let pen = "moveTo";
    for (let i = 0; i < xs.length; i++) {
      if (xs[i] !== null) ctx[pen](plot.valToPos(xs[i], "x", true), plot.valToPos(ys[i], "y", true));
      pen = xs[i] === null ? "moveTo" : "lineTo";
    }
    ctx.stroke();
    if (xs.length && xs.at(-1) !== null) { // where it is now
      ctx.fillStyle = colour;
      ctx.beginPath();
      ctx.arc(plot.valToPos(xs.at(-1), "x", true), plot.valToPos(ys.at(-1), "y", true), 4 * devicePixelRatio, 0, 7);
      ctx.fill();
    }
    ctx.restore();
    return null;
  }
}

const names = (count) => [...Array(count).keys()];

/** The two choices of signals, as fields: changed(x, y) is called with their keys. */
export function axisFields(signals, keys, number, changed) {
  const fields = ["x", "y"].map((axis, place) => {
    const select = document.createElement("select");
    select.setAttribute("aria-label", `${axis} of XY plot ${number}`);
    const groups = Map.groupBy(signals, ({ group }) => group);
    for (const [name, members] of groups) {
      const group = document.createElement("optgroup");
      group.label = name;
      group.append(...members.map(({ key, label, unit }) => new Option(unit ? `${label} [${unit}]` : label, key)));
      select.append(group);
    }
    select.value = keys[place];
    return select;
  });
  for (const field of fields) field.onchange = () => changed(fields.map(({ value }) => value));
  return fields;
}
