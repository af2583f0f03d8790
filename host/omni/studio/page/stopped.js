// SPDX-License-Identifier: MIT
// What stopped the robot: it stays in sight until the robot is armed again, with a button for the next step.

import { id, put } from "./words.js";

const WHAT = { failsafe: "Stopped by a failsafe", estop: "Emergency stop" };
const NEXT = { failsafe: ["Disarm", "disarm"], estop: ["Release stop", "release"] };
const AGAIN = ["Arm again", "arm"];

/** Why the robot cannot be armed or driven now, and which button helps; "" if it is armed and drives. */
export function obstacle({ state, armed }) {
  if (state === "failsafe") return "The robot is in failsafe: press Disarm first, then Arm.";
  if (state === "estop") return "The emergency stop is on: press Release stop first, then Arm.";
  return armed ? "" : "The robot is not armed: press Arm first.";
}

/** @param now the whole state, null without a server; watching: why this page may not command, "" if it may */
export function show_stop(now, watching) {
  const [stop, robot] = [now?.last_stop ?? null, now?.robot ?? null];
  id("stopped").hidden = !stop || !robot;
  if (!stop || !robot) {
    put("stopped-what", "");
    put("stopped-values", "");
    return;
  }
  const wheel = stop.wheel ? `wheel ${stop.wheel}` : "";
  const cause = [stop.cause, wheel].filter(Boolean).join(", ");
  put("stopped-what", WHAT[stop.state] + (cause ? `: ${cause}` : ""));
  const present = robot.faults.filter((fault) => stop.cause.split(", ").includes(fault));
  const still = robot.state === "disarmed" && present.length ? `still present: ${present.join(", ")}` : "";
  const values = stop.values.map((text) => text.replace(`${wheel}: `, ""));
  put("stopped-values", [...values, still].filter(Boolean).join("; "));
  const [words, button] = NEXT[robot.state] ?? AGAIN;
  put("stopped-next", words);
  id("stopped-next").onclick = () => id(button).click();
  id("stopped-next").disabled = Boolean(watching) && button !== "disarm";
  id("stopped-next").title = id("stopped-next").disabled ? watching : "";
}
