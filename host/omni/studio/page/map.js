// SPDX-License-Identifier: MIT
// The floor from above: robot, its way, its uncertainty, what it follows, and the target that a click sets.

import { ellipse } from "./ellipse.js";
import { Fixes } from "./fixes.js";
import { in_words } from "./words.js";

const TRAIL_MOST = 4000;
const TRAIL_STEP_M = 0.003;
const SEND_MS = 100; // a target is repeated, so that a dead page stops the robot
const CLOSE_M = 0.005;
const CLOSE_RAD = 0.02;
const SIGMA = 3;
const FADE_MS = 100; // between two drawings of fixes that fade
const SLIP_S = 0.5; // a wheel's slip is drawn as the way of so long
const DRAW_STEP_M = 0.005;
const DRAW_MOST = 5000;

export class FloorMap {
  #trail = [];
  #wanted = [];
  #state = null;
  #centre = [0, 0];
  #metres = 2; // across
  #target = null;
  #timer = null;
  #drag = null;
  #drawn = [];
  #planned = [];
  #fixes = new Fixes();
  #drawn_at = 0;
  #stale = true;
  #drawing = false;
  #drew = false; // the finger that is down, or was last
  #touched = false; // by a finger, not a mouse: not every browser says it with the click

  constructor(canvas, socket, on) {
    this.canvas = canvas;
    this.socket = socket;
    this.on = on; // {target(pose), drawn(line), arrived(), refused(text), going(bool)}
    this.follow = true;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#metres = Math.min(50, Math.max(0.2, this.#metres * (event.deltaY > 0 ? 1.2 : 1 / 1.2)));
      this.#stale = true;
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !event.isPrimary) return; // a right click or a second finger moves no robot
      this.#drew = this.drawing;
      this.#touched = event.pointerType === "touch";
      if (this.#touched && !this.drawing) return; // it may begin to scroll the page: see "click"
      const [x, y] = this.#floor(event);
      canvas.setPointerCapture(event.pointerId);
      if (this.drawing) this.#draw_from(x, y);
      else this.#drag = { x, y, theta: this.#state?.pose?.[2] ?? 0 };
    });
    canvas.addEventListener("pointermove", (event) => {
      const [x, y] = this.#floor(event);
      if (this.drawing && event.isPrimary && event.buttons & 1) this.#draw_to(x, y);
      if (!this.#drag || !event.isPrimary) return;
      const [dx, dy] = [x - this.#drag.x, y - this.#drag.y];
      if (Math.hypot(dx, dy) > 0.03) this.#drag.theta = Math.atan2(dy, dx);
      this.#target = { ...this.#drag };
      this.#stale = true;
    });
    canvas.addEventListener("pointerup", (event) => {
      if (event.button !== 0 || !event.isPrimary) return;
      const drag = this.#drag;
      this.#drag = null;
      if (drag) this.on.target(drag);
      else if (this.drawing && this.#drawn.length > 1) this.on.drawn(this.#drawn);
    });
    canvas.addEventListener("click", (event) => { // a finger's tap: neither a swipe nor what ends a scroll is one
      if (!this.#touched || this.#drew) return;
      const [x, y] = this.#floor(event);
      this.on.target({ x, y, theta: this.heading });
    });
    canvas.addEventListener("pointercancel", () => { this.#drag = null; }); // the browser took it for something else
    new ResizeObserver(() => { this.#stale = true; }).observe(canvas);
    const draw = () => { this.#draw(); requestAnimationFrame(draw); };
    requestAnimationFrame(draw);
  }

  /** Whether a mouse or a finger draws a path instead of setting a target. */
  get drawing() { return this.#drawing; }

  set drawing(on) {
    this.#drawing = on;
    this.canvas.classList.toggle("drawing", on); // then a swipe does not scroll the page
  }

  get going() { return this.#timer !== null; }

  get heading() { return this.#state?.pose?.[2] ?? 0; }

  state(robot) {
    if (!robot && this.#trail.at(-1)) this.#trail.push(null); // what it drives unheard is not known
    this.#state = robot;
    const pose = robot?.pose;
    if (pose) {
      append(this.#trail, pose);
      if (robot.reference && robot.phase !== "none") append(this.#wanted, robot.reference);
      if (this.follow && !this.drawing) this.#centre = [pose[0], pose[1]];
      if (this.going && close(pose, this.#target)) this.on.arrived();
    }
    if (this.going && !robot?.armed) this.cancel();
    this.#stale = true;
  }

  /** The robot has looked at these pose fixes. */
  fixes(fixes) {
    this.#fixes.add(fixes, performance.now());
    this.#stale = true;
  }

  /** Pose fixes that are shown, oldest first: [{x, y, result, at}]. */
  get marked() { return this.#fixes.shown; }

  /** Why the last refused fix was refused; "": none was. */
  get refused() { return this.#fixes.refused; }

  /** The ellipse around the robot; null without a robot. Half axes in metres, the angle in radians. */
  get ellipse() {
    const { pose, pose_sd, pose_correlation } = this.#state ?? {};
    return pose ? ellipse((pose_sd ?? [0, 0]).map((sd) => sd ?? 0), pose_correlation ?? 0, SIGMA) : null;
  }

  clear_trail() {
    this.#trail = [];
    this.#wanted = [];
    this.#stale = true;
  }

  /** Forget what was: another robot may have come. */
  clear() {
    this.#fixes.clear();
    this.clear_trail();
  }

  /** What is drawn so far, as [x, y] in metres. */
  get line() { return this.#drawn; }

  /** Show what the robot will follow instead of what was drawn; nothing: forget both. */
  planned(line) {
    this.#planned = line ?? [];
    if (!line) this.#drawn = [];
    this.#stale = true;
  }

  #draw_from(x, y) {
    this.#planned = [];
    this.#drawn = [[x, y]];
    this.#stale = true;
  }

  #draw_to(x, y) {
    const [lx, ly] = this.#drawn[this.#drawn.length - 1] ?? [Infinity, 0];
    if (Math.hypot(x - lx, y - ly) < DRAW_STEP_M || this.#drawn.length >= DRAW_MOST) return;
    this.#drawn.push([x, y]);
    this.#stale = true;
  }

  /** Drive to a pose and hold it until cancel(); the page repeats it. */
  go(target) {
    this.cancel();
    this.#target = target;
    const send = () => this.socket.ask("pose", target).catch((refusal) => {
      if (!this.going || this.#target !== target) return; // it was cancelled, or another one is wanted by now
      this.cancel();
      this.on.refused(in_words(refusal));
    });
    this.#timer = setInterval(send, SEND_MS);
    this.on.going(true);
    send();
  }

  cancel() {
    if (this.#timer === null) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.on.going(false);
  }

  #scale() { return this.canvas.width / this.#metres; }

  #floor(event) {
    const box = this.canvas.getBoundingClientRect();
    const scale = box.width / this.#metres;
    return [
      this.#centre[0] + (event.clientX - box.left - box.width / 2) / scale,
      this.#centre[1] - (event.clientY - box.top - box.height / 2) / scale,
    ];
  }

  #pixel([x, y]) {
    const scale = this.#scale();
    return [
      this.canvas.width / 2 + (x - this.#centre[0]) * scale,
      this.canvas.height / 2 - (y - this.#centre[1]) * scale,
    ];
  }

  #draw() {
    const now = performance.now();
    const fading = this.#fixes.shown.length > 0 && now - this.#drawn_at > FADE_MS;
    if (!(this.#stale || fading) || document.hidden) return;
    this.#stale = false;
    this.#drawn_at = now;
    const { canvas } = this;
    const size = Math.round(canvas.clientWidth * devicePixelRatio);
    if (canvas.width !== size) canvas.width = canvas.height = size;
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const c = canvas.getContext("2d");
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.lineWidth = devicePixelRatio;
    this.#grid(c, colour("--line"), colour("--quiet"));
    this.#fixes.draw(c, (place) => this.#pixel(place), colour, now);
    this.#line(c, this.#wanted, colour("--warn"), [6, 4]);
    if (this.#planned.length) this.#line(c, this.#planned, colour("--good"), []);
    else this.#line(c, this.#drawn, colour("--good"), [2, 3]);
    this.#line(c, this.#trail, colour("--accent"), []);
    if (this.#target) this.#robot(c, [this.#target.x, this.#target.y, this.#target.theta], colour("--quiet"), [4, 3]);
    const pose = this.#state?.pose;
    if (!pose) return;
    this.#draw_ellipse(c, pose, colour("--warn"));
    this.#robot(c, pose, colour("--text"), []);
    this.#slips(c, pose, this.#state.slip_m_s ?? [], colour("--warn"));
  }

  #grid(c, line, text) {
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10].find((size) => size > this.#metres / 9) ?? 10;
    const first = (centre) => Math.ceil((centre - this.#metres / 2) / step) * step;
    c.strokeStyle = line;
    c.fillStyle = text;
    c.font = `${11 * devicePixelRatio}px system-ui`;
    c.setLineDash([]);
    for (let x = first(this.#centre[0]); x < this.#centre[0] + this.#metres / 2; x += step) {
      const [px] = this.#pixel([x, 0]);
      stroke(c, [[px, 0], [px, this.canvas.height]]);
      c.fillText(`${Number(x.toFixed(2))}`, px + 3, this.canvas.height - 4);
    }
    for (let y = first(this.#centre[1]); y < this.#centre[1] + this.#metres / 2; y += step) {
      const [, py] = this.#pixel([0, y]);
      stroke(c, [[0, py], [this.canvas.width, py]]);
      c.fillText(`${Number(y.toFixed(2))} m`, 3, py - 3);
    }
  }

  #line(c, points, colour, dash) {
    c.strokeStyle = colour;
    c.setLineDash(dash);
    stroke(c, points.map((point) => point && this.#pixel(point)));
  }

  #robot(c, pose, colour, dash) {
    const [x, y] = this.#pixel(pose);
    const radius = Math.max(6 * devicePixelRatio, (this.radius ?? 0.12) * this.#scale());
    c.strokeStyle = colour;
    c.setLineDash(dash);
    c.beginPath();
    c.arc(x, y, radius, 0, 2 * Math.PI);
    c.moveTo(x, y);
    c.lineTo(x + radius * Math.cos(pose[2]), y - radius * Math.sin(pose[2]));
    c.stroke();
    for (const angle of this.wheels ?? []) {
      const bearing = pose[2] + angle;
      const [wx, wy] = [x + radius * Math.cos(bearing), y - radius * Math.sin(bearing)];
      const [tx, ty] = [radius * 0.25 * Math.sin(bearing), radius * 0.25 * Math.cos(bearing)];
      c.lineWidth = 4 * devicePixelRatio;
      stroke(c, [[wx - tx, wy - ty], [wx + tx, wy + ty]]);
      c.lineWidth = devicePixelRatio;
    }
  }

  /** A bar outwards from each wheel, as long as it slips in SLIP_S. */
  #slips(c, pose, slips, colour) {
    const [x, y] = this.#pixel(pose);
    const radius = (this.radius ?? 0.12) * this.#scale();
    c.strokeStyle = colour;
    c.lineWidth = 5 * devicePixelRatio;
    for (const [wheel, angle] of (this.wheels ?? []).entries()) {
      const bearing = pose[2] + angle;
      const end = radius + Math.abs(slips[wheel] ?? 0) * SLIP_S * this.#scale();
      stroke(c, [radius, end].map((r) => [x + r * Math.cos(bearing), y - r * Math.sin(bearing)]));
    }
    c.lineWidth = devicePixelRatio;
  }

  #draw_ellipse(c, pose, colour) {
    const [x, y] = this.#pixel(pose);
    const { major, minor, angle } = this.ellipse;
    c.strokeStyle = colour;
    c.setLineDash([]);
    c.beginPath();
    c.ellipse(x, y, major * this.#scale(), minor * this.#scale(), -angle, 0, 2 * Math.PI); // y of pixels points down
    c.stroke();
  }
}

function append(points, [x, y]) {
  const last = points[points.length - 1];
  if (last && Math.hypot(x - last[0], y - last[1]) < TRAIL_STEP_M) return;
  points.push([x, y]);
  if (points.length > TRAIL_MOST) points.splice(0, TRAIL_MOST / 4);
}

function close([x, y, theta], target) {
  const turn = Math.abs(Math.atan2(Math.sin(theta - target.theta), Math.cos(theta - target.theta)));
  return Math.hypot(x - target.x, y - target.y) < CLOSE_M && turn < CLOSE_RAD;
}

function stroke(c, points) {
  c.beginPath();
  let pen = "moveTo";
  for (const point of points) { // null: a gap
    if (point) c[pen](...point);
    pen = point ? "lineTo" : "moveTo";
  }
  c.stroke();
}
