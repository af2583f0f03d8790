// SPDX-License-Identifier: MIT
// How the curves of a plot look, and the range of their axis.

import uPlot from "../vendor/uPlot.esm.js";

// Okabe and Ito's colours, which colour-blind people tell apart; dashes repeat the difference.
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b88a00", "#56b4e9"];
// Of the second of two logs: others, and dashed.
const COMPARED = ["#7f5fd6", "#e15759", "#7aa52a", "#9c755f", "#8a8a8a", "#00a5a5"];
const DASHES = [[], [2, 3], [10, 3, 2, 3]];
const COMPARED_DASHES = [[8, 4], [5, 5], [14, 4]];

/** {stroke, dash} of the curve with this number; curves of the same signal in each of so many logs are neighbours. */
export function look(number, logs = 1) {
  const [signal, log] = [Math.floor(number / logs), number % logs];
  const dashes = log === 0 ? DASHES : COMPARED_DASHES;
  return {
    stroke: (log === 0 ? COLOURS : COMPARED)[signal % COLOURS.length],
    dash: dashes[Math.floor(signal / COLOURS.length) % dashes.length],
  };
}

/** The range of the axis for values from low to high; null: there are none. A constant is in the middle. */
export function y_range(_, low, high) {
  if (low === null || high === null) return [-1, 1];
  if (high > low) return uPlot.rangeNum(low, high, 0.1, true);
  const half = Math.abs(low) * 0.1 || 1;
  return [low - half, high + half];
}
