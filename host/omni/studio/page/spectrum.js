// SPDX-License-Identifier: MIT
// The frequencies in what a plot shows. The server computes them.

import uPlot from "../vendor/uPlot.esm.js";
import { axis_style, id, in_words, put, show_lines } from "./words.js";

const HEIGHT_PX = 320;
const LEAST_SHARE = 1e-5; // of the largest line: the axis is logarithmic, and has no zero

let shown = null; // {plot}, what the window shows: another object once something else is asked for

function forget() {
  shown?.plot?.destroy();
  shown = null;
}

/** Show the spectra of these signals between two times, in a window of its own. */
export async function showSpectrum(socket, { signals, labels, units, looks, begin, end }) {
  const dialog = id("spectrum-dialog");
  forget();
  const mine = shown = { plot: null };
  id("spectrum-list").replaceChildren();
  id("spectrum-plot").replaceChildren();
  id("spectrum-range").textContent = `${begin.toFixed(2)} s to ${end.toFixed(2)} s`;
  if (!dialog.open) dialog.showModal();
  id("close-spectrum").onclick = () => dialog.close();
  dialog.onclose = forget;
  let found;
  try {
    found = await socket.ask("spectrum", { signals, begin_s: begin, end_s: end });
  } catch (refusal) {
    if (shown === mine) put("spectrum-range", in_words(refusal));
    return;
  }
  if (shown !== mine) return; // closed, or another one was asked for
  const places = found.map(({ key }) => signals.indexOf(key)); // not every log has every signal
  const axis = axis_style();
  const data = [];
  for (const { Hz, amplitude, peak } of found) {
    data.push([Hz, amplitude.map((value) => Math.max(value, peak.amplitude * LEAST_SHARE) || null)]);
  }
  mine.plot = new uPlot({
    width: Math.min(560, innerWidth - 70),
    height: HEIGHT_PX,
    scales: { x: { time: false }, y: { distr: 3 } },
    axes: [{ ...axis, label: "frequency [Hz]", size: 34, labelSize: 16 },
      { ...axis, label: `amplitude ${[...new Set(units)].join(", ")}`, size: 62 }],
    series: [{ label: "frequency [Hz]", value: (_, f) => (f == null ? "–" : f.toFixed(3)) },
      ...places.map((n) => ({
        label: labels[n], ...looks[n], width: 1.5, spanGaps: true, points: { show: false },
        value: (_, v) => (v == null ? "–" : `${Number(v.toPrecision(4))} ${units[n]}`),
      }))],
  }, uPlot.join(data), id("spectrum-plot"));
  show_lines(id("spectrum-list"), found.map(({ peak, resolution_Hz }, place) => {
    const n = places[place];
    const in_unit = units[n] ? ` ${units[n]}` : "";
    return `${labels[n]}: largest at ${peak.Hz} Hz, ${peak.amplitude}${in_unit}; resolution ${resolution_Hz} Hz`;
  }));
}
