// SPDX-License-Identifier: MIT
// Pose fixes on the map: one sign for what the robot took in, another for what it refused. They fade with their age.

const MOST = 400;
// By result: how it is drawn, how large, in which colour, and how long it stays.
const KINDS = {
  used: { path: plus, size_px: 3, colour: "--good", stays_ms: 3000 },
  ignored: { path: ring, size_px: 3, colour: "--quiet", stays_ms: 3000 },
};
const REFUSED = { path: cross, size_px: 5, colour: "--stop", stays_ms: 15000 };
const WHY = { "too far": "it failed the outlier gate", unusable: "it came too late, too early or out of order" };

const kind_of = ({ result }) => KINDS[result] ?? REFUSED;

export class Fixes {
  #marks = []; // {x, y, result, at}, oldest first
  #refused = ""; // why the last one was

  /** @param fixes [{pose: [x, y, theta], result}], @param now when they came [ms] */
  add(fixes, now) {
    for (const { pose: [x, y], result } of fixes) {
      this.#marks.push({ x, y, result, at: now });
      if (!(result in KINDS)) this.#refused = WHY[result] ?? result;
    }
    this.#forget(now);
  }

  clear() {
    this.#marks = [];
    this.#refused = "";
  }

  /** What is shown, oldest first: [{x, y, result, at}]. */
  get shown() { return this.#marks; }

  /** Why the last one was refused; "": none was. */
  get refused() { return this.#refused; }

  #forget(now) {
    this.#marks = this.#marks.filter((mark) => now - mark.at < kind_of(mark).stays_ms).slice(-MOST);
  }

  /** Draw all on a canvas; pixel: the place of [x, y], colour: the value of a colour's name. */
  draw(c, pixel, colour, now) {
    this.#forget(now);
    c.save();
    c.setLineDash([]);
    c.lineWidth = devicePixelRatio;
    for (const mark of this.#marks) {
      const { path, size_px, colour: name, stays_ms } = kind_of(mark);
      c.globalAlpha = 1 - (now - mark.at) / stays_ms;
      c.strokeStyle = colour(name);
      c.beginPath();
      path(c, ...pixel([mark.x, mark.y]), size_px * devicePixelRatio);
      c.stroke();
    }
    c.restore();
  }
}

function plus(c, x, y, size) {
  c.moveTo(x - size, y);
  c.lineTo(x + size, y);
  c.moveTo(x, y - size);
  c.lineTo(x, y + size);
}

function cross(c, x, y, size) {
  c.moveTo(x - size, y - size);
  c.lineTo(x + size, y + size);
  c.moveTo(x - size, y + size);
  c.lineTo(x + size, y - size);
}

function ring(c, x, y, size) {
  c.moveTo(x + size, y);
  c.arc(x, y, size, 0, 2 * Math.PI);
}
