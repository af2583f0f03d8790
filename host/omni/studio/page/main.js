// SPDX-License-Identifier: MIT
// Puts the page together. What the robot is and does comes from the server; nothing here knows it.

import { BringUp } from "./bringup.js";
import { Chooser } from "./connect.js";
import { DrawnPath } from "./draw.js";
import { Experiments } from "./experiments.js";
import { Flasher } from "./flasher.js";
import { Gamepad } from "./gamepad.js";
import { Keys } from "./keys.js";
import { FloorMap } from "./map.js";
import { all_numbers, fill_number, number_in, watch_numbers } from "./numbers.js";
import { ParameterList } from "./parameters.js";
import { Plots } from "./plots.js";
import { Runs } from "./runs.js";
import { Simulator } from "./simulator.js";
import { Socket } from "./socket.js";
import { obstacle, show_stop } from "./stopped.js";
import { HeldVelocity } from "./velocity.js";
import { id, in_words, put, show_lines } from "./words.js";

const TEXTS_KEPT = 100;
const LOSSY = 0.05; // a share of frames lost that makes plots and commands worse
const OFF_PACE = 0.1; // a robot whose clock is off by this share lives in a simulation that is not in real time
const WARNING = 4; // severity as in syslog
const MINE = "this page"; // what the server says to the page that commands
let state = null;
let unfinished = 0; // requests that a lost server has not answered

let said = 0; // how often
const say = (words) => { said += 1; put("notice", words); };
/** What was said since a request stays: an answer that comes late does not wipe it. */
const ask = (action, content) => {
  const before = said;
  return socket.ask(action, content).then(
    (result) => { if (said === before) say(""); return result; }, (refusal) => say(in_words(refusal)));
};

const socket = new Socket({
  open: () => {
    say(unfinished ? "The studio's server responds again. The last request may not have been executed." : "");
    unfinished = 0;
    runs.refresh();
  },
  lost: (requests) => {
    unfinished += requests;
    show_state(null);
    say("The studio's server does not respond. This page reconnects: start omni studio if it has ended.");
  },
  samples: (found) => plots.samples(found),
  news,
});
const runs = new Runs(socket, say);
const parameters = new ParameterList(id("parameter-list"), socket);
const plots = new Plots(id("panels"), socket, say, { limit: (name) => parameters.value_of(name) });
const flasher = new Flasher(socket);
const chooser = new Chooser(socket, flasher, say);
const map = new FloorMap(id("map"), socket, {
  target: (pose) => { fill_target(pose); start_going(); },
  arrived: () => { id("map-text").textContent = "arrived; holding the pose"; },
  refused: (words) => { say(words); hold(); },
  drawn: () => drawn.drawn(),
  going: (going) => { id("cancel").disabled = !going; if (!going) id("map-text").textContent = ""; },
});
const drawn = new DrawnPath(map, ask, { armed, begin: begin_path });
const experiments = new Experiments(socket, ask);
const bring_up = new BringUp(socket, ask);
const simulator = new Simulator(id("simulator"), ask);
const velocity = new HeldVelocity(socket, {
  refused: say, begins: () => map.cancel(), moving: (words) => put("key-text", words) });
const keys = new Keys(velocity);
const gamepad = new Gamepad(velocity, { stop, found: (words) => put("gamepad-text", words) });

// ---- what the server says

function news(message) {
  if (message.forget) forget_robot();
  if (message.tables) tables(message.tables);
  if (message.parameters) parameters.values(message.parameters);
  if (message.marks) plots.marks(message.marks);
  if (message.fixes) map.fixes(message.fixes);
  if (message.texts) message.texts.forEach(add_text);
  if (message.state) show_state(message.state);
  if (message.error) say(message.error);
}

/** again: the link came back, and what was shown before goes on. */
function tables({ again, signals, view, wheels, radius_m, speed, paths, path, ...lists }) {
  experiments.tables(lists.experiments);
  simulator.tables(lists.world);
  bring_up.tables(lists.bring_up, wheels);
  parameters.tables(lists.parameters, again);
  plots.tables(signals, view, again);
  if (view && !again) id("span").value = view.span_s;
  id("rate").value = ""; // each connection begins with its automatic rates
  velocity.top = speed;
  map.wheels = wheels;
  map.radius = radius_m;
  if (!again) {
    fill_number(id("draw-speed"), (speed.v / 2).toPrecision(2));
    map.clear();
  }
  id("path").replaceChildren(...paths.map((name) => new Option(name, name)));
  if (paths.includes(path)) id("path").value = path;
}

/** What is shown of the robot before this one, or of none. Its plots stay until the next one: they may be saved. */
function forget_robot() {
  id("texts").replaceChildren();
  parameters.tables([]);
  map.clear();
}

function add_text({ severity, text }) {
  const item = document.createElement("li");
  item.textContent = text;
  if (severity <= WARNING) item.className = "warning";
  id("texts").append(item);
  while (id("texts").children.length > TEXTS_KEPT) id("texts").firstChild.remove();
  id("texts").scrollTop = id("texts").scrollHeight;
}

function show_state(now) {
  const ended = now?.drive_ended ?? "";
  if (ended && ended !== state?.drive_ended) {
    release_controls();
    if (now.robot?.state !== "failsafe") say(ended); // then the reason of the stop stands above
  }
  if (state?.commands === MINE && now && now.commands !== MINE) release_controls();
  state = now;
  runs.recording(now?.recording, now?.link.phase === "connected");
  const robot = now?.robot ?? null;
  const link = now?.link ?? { phase: "none" };
  const connecting = robot ? "reading its parameters …" : "connecting …";
  const phases = { none: "no robot", connecting, lost: "lost", closed: "no robot" };
  const where = now?.simulated ? `simulated: ${now.simulated}` : link.url;
  put("fact-link", link.phase === "connected" ? where : phases[link.phase] ?? link.phase);
  put("fact-quality", link.quality ? quality_in_words(link) : "–");
  id("fact-quality").className = link.quality?.lost >= LOSSY ? "bad" : "";
  id("fact-link").className = link.phase === "lost" ? "bad" : "";
  put("fact-state", robot ? robot.state : "–");
  id("fact-state").className = robot ? `state-${robot.state}` : "";
  put("fact-mode", robot?.mode ?? "–");
  put("fact-supply", robot?.supply_V ? `${robot.supply_V.toFixed(1)} V` : "–");
  put("fact-commands", now?.commands ?? "–");
  const trouble = link.phase === "connected" ? "" : link.trouble ?? "";
  put("faults", robot?.faults.length ? `Faults: ${robot.faults.join(", ")}` : trouble);
  id("welcome").hidden = !now || link.phase !== "none";
  id("take-over").hidden = !now || now.commands === MINE;
  const unheard = robot && link.phase === "connected" ? "" : "No robot is connected.";
  const drives = robot?.armed && !ended ? "The robot is armed." : ""; // armed and held: arm again
  const stopped = ["failsafe", "estop"].includes(robot?.state) ? obstacle(robot) : "";
  disable("arm", unheard || drives || stopped);
  disable("disarm", robot ? "" : "No robot is connected.");
  disable("release", robot?.state === "estop" ? "" : "No emergency stop is on.");
  const watching = watches_only(now);
  put("watching", watching && robot ? watching : "");
  for (const group of document.querySelectorAll("fieldset.commands")) {
    group.disabled = watching !== "";
    group.title = watching;
  }
  id("map").classList.toggle("watching", watching !== "");
  show_stop(now, watching);
  for (const name of ["undo", "redo"]) {
    id(name).disabled = !now?.[name];
    put(name, `${name[0].toUpperCase()}${name.slice(1)}${now?.[name] ? ` (${now[name]})` : ""}`);
  }
  experiments.state(now);
  flasher.state(now?.flash ?? null);
  simulator.state(now?.world ?? null);
  bring_up.state(now);
  if (!robot?.armed) gamepad.mustRest();
  parameters.armed(robot?.armed ?? false);
  map.state(robot);
  put("fix-text", robot ? fixes_in_words(robot.fixes, map.refused, link.quality?.radio) : "");
  put("quality-text", robot?.quality?.text ?? "");
  id("quality-text").dataset.verdict = robot?.quality?.verdict ?? "";
  put("quality-advice", robot?.quality?.advice ?? "");
  show_sensors(robot?.sensors ?? []);
  if (robot?.pose) {
    const [x, y, theta] = robot.pose;
    id("map").setAttribute("aria-label",
      `Robot at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, heading ${degrees(theta)}°. The fields below set a target.`);
  }
}

/** A line for each sensor that the robot has; what it does not have is hidden. */
function show_sensors(sensors) {
  for (const [name, place] of [["gyro", "gyro"], ["floor odometry", "floor"]]) {
    const one = sensors.find((sensor) => sensor.name === name);
    put(`${place}-text`, one ? `${name}: ${one.text}` : "");
    put(`${place}-advice`, one?.advice ?? "");
    id(`${place}-text`).dataset.good = one?.good ?? "";
    id(`${place}-text`).hidden = !one;
    id(`${place}-advice`).hidden = !one?.advice;
  }
}

function quality_in_words({ bytes_per_s, quality: { lost, round_trip_ms, asking, budget_B_s, pace, radio } }) {
  const kilo = (bytes) => (bytes / 1000).toPrecision(3);
  return [
    radio ? "radio, at its own rates" : "",
    lost === null ? "no frames" : `${(100 * lost).toFixed(1)} % lost`,
    round_trip_ms === null ? (asking ? "no reply" : "") : `${round_trip_ms.toFixed(0)} ms`,
    `${kilo(bytes_per_s)}${budget_B_s ? ` of ${kilo(budget_B_s)}` : ""} kB/s`,
    pace !== null && Math.abs(pace - 1) > OFF_PACE ? `runs at ${pace.toFixed(2)} × real time` : "",
  ].filter(Boolean).join(", ");
}

function fixes_in_words(counts, why, radio) {
  const missing = "Pose fixes are not shown: this slow link does not carry them. Choose a rate under Samples.";
  if (!counts) return radio ? missing : "";
  const reason = why ? `, the last because ${why}` : "";
  return `Pose fixes: ${counts.used} used, ${counts.refused} rejected${reason}.`;
}

const degrees = (angle) => Math.round((angle * 180) / Math.PI);

// ---- what the person does

watch_numbers();
new ResizeObserver(() => { // on a phone, its buttons stay in sight
  const actions = document.querySelector("header .actions");
  document.documentElement.style.setProperty("--above-actions", `${actions.offsetTop - 4}px`);
}).observe(id("facts"));

/** Nothing that is held or repeated moves the robot from here on. */
function release_controls() {
  map.cancel();
  keys.stop();
  gamepad.mustRest();
  velocity.letGo();
}

function stop() {
  release_controls();
  ask("stop").then((result) => {
    if (result && !result.told) say("No robot is connected: no stop was sent.");
  });
}

const is_a = ({ target }, what) => target instanceof Element && target.matches(what);

// The space bar stops, whatever has the focus, but where a space is typed as text. Enter presses buttons.
addEventListener("keydown", (event) => {
  if (event.code !== "Space" || is_a(event, "input[type=search], #url")) return;
  event.preventDefault();
  event.stopPropagation();
  if (!event.repeat) stop();
}, { capture: true });
addEventListener("keyup", (event) => { // a button would be pressed by the key's release
  if (event.code === "Space" && is_a(event, "button, input[type=checkbox], summary, a")) event.preventDefault();
}, { capture: true });

for (const button of document.querySelectorAll(".stop")) { // one in each window that covers the others
  button.onclick = stop;
  button.onpointerdown = stop; // already when the finger comes down
}
id("welcome-connect").onclick = () => chooser.open();
id("arm").onclick = () => ask("arm");
id("disarm").onclick = () => {
  release_controls();
  ask("disarm");
};
id("release").onclick = () => ask("release");
id("take-over").onclick = () => ask("take_over");
for (const name of ["undo", "redo"]) id(name).onclick = () => ask(name);
id("store").onclick = async () => {
  if (await ask("store") === undefined) return;
  say(state?.simulated ? "Stored: the simulated robot keeps it, also restarted, until omni studio ends."
    : "Stored in the robot's flash.");
};
id("save").href = `parameters.toml?token=${encodeURIComponent(socket.token)}`;
id("load").onchange = async (event) => {
  const [file] = event.target.files;
  if (file) await ask("load", { text: await file.text() });
  event.target.value = "";
};
id("search").oninput = (event) => { parameters.search = event.target.value; parameters.filter(); };
id("only-changed").onchange = (event) => { parameters.onlyChanged = event.target.checked; parameters.filter(); };
id("span").onchange = (event) => plots.span(Number(event.target.value));
id("rate").onchange = (event) => ask("rate", { hz: event.target.value ? Number(event.target.value) : null });
id("pause").onclick = () => (plots.paused ? plots.live() : plots.pause());
plots.on_pause = (paused) => {
  id("pause").setAttribute("aria-pressed", paused);
  put("pause", paused ? "Go on" : "Pause");
  if (!paused) show_lines(id("measured"), []);
};
plots.on_mark = (words) => put("mark-text", words);
plots.on_measure = (seconds, lines) => {
  put("mark-text", `${seconds.toPrecision(4)} s selected; double-click to resume`);
  show_lines(id("measured"), lines);
};
id("add-plot").onclick = () => plots.add();
id("add-xy").onclick = () => plots.addXY();
plots.on_view = (view) => { // kept with the robot by the page that commands; others keep it in the browser
  if (state?.robot && state.commands === MINE) ask("save_view", { view });
};
id("csv").onclick = () => plots.csv();
id("follow").onchange = (event) => { map.follow = event.target.checked; };
id("clear-trail").onclick = () => map.clear_trail();
id("keys").onchange = (event) => { keys.enabled = event.target.checked; keys.stop(); };
id("gamepad").onchange = (event) => gamepad.enable(event.target.checked);
id("key-speed").oninput = (event) => { velocity.share = Number(event.target.value) / 100; };
id("start-path").onclick = () => {
  if (!armed() || !all_numbers(id("laps"))) return;
  begin_path("start_trajectory", { type: id("path").value, laps: number_in(id("laps")) });
};
id("stop-path").onclick = () => ask("stop_trajectory");
id("cancel").onclick = () => { map.cancel(); ask("velocity", { vx: 0, vy: 0, wz: 0 }); };
id("target-form").onsubmit = (event) => { event.preventDefault(); start_going(); };

function fill_target({ x, y, theta }) {
  fill_number(id("target-x"), x.toFixed(3));
  fill_number(id("target-y"), y.toFixed(3));
  fill_number(id("target-theta"), degrees(theta));
}

/** Whether this page may move the robot now; if not, it says what to do first. */
function armed() {
  const trouble = state?.robot ? watches_only(state) || obstacle(state.robot)
    : "No robot is connected: press Connect first.";
  if (trouble) say(trouble);
  return !trouble;
}

/** Why this page does not command; "": it does. */
function watches_only(now) {
  if (!now || now.commands === MINE) return "";
  const who = now.commands === "no page" ? "No page is in command" : `Another page (${now.commands}) is in command`;
  return `${who}: press Take over to command from here.`;
}

function disable(name, reason) {
  id(name).disabled = reason !== "";
  id(name).title = reason;
}

/** End a stream of setpoints at rest: without this, the robot ends it by a failsafe. */
function hold() {
  if (state?.robot?.armed && !watches_only(state)) socket.ask("stop_trajectory").catch(() => {});
}

async function begin_path(action, content) {
  const streams = map.going || velocity.held;
  release_controls();
  if (await ask(action, content) === undefined && streams) hold();
}

function start_going() {
  if (!armed() || !all_numbers(id("target-x"), id("target-y"), id("target-theta"))) return;
  say("");
  map.go({
    x: number_in(id("target-x")),
    y: number_in(id("target-y")),
    theta: (number_in(id("target-theta")) * Math.PI) / 180,
  });
}

window.studio = { plots, runs, map, parameters, get state() { return state; } }; // for tests and the curious
