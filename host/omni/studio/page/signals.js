// SPDX-License-Identifier: MIT
// The dialog in which the signals of a plot are chosen.

import { id, put } from "./words.js";

const MOST = 12;

/** Show the list; resolves with the chosen keys, new ones last, or null if the dialog is left by Escape. */
export function chooseSignals(signals, chosen) {
  const dialog = id("signal-dialog");
  const list = id("signal-list");
  const search = id("signal-search");
  const wanted = new Set(chosen);
  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const text = ({ key, label, doc }) => `${key} ${label} ${doc}`.toLowerCase();
    const fits = (signal) => words.every((word) => text(signal).includes(word));
    const groups = Map.groupBy(signals.filter(fits), (signal) => signal.group);
    list.replaceChildren(...[...groups].map(([name, members]) => group(name, members, wanted)));
  };
  search.value = "";
  put("signal-text", "");
  search.oninput = show;
  show();
  dialog.showModal();
  search.focus();
  dialog.returnValue = "";
  id("close-signals").onclick = () => dialog.close("done");
  return new Promise((done) => {
    dialog.onclose = () => done(dialog.returnValue === "done" ? [...wanted] : null);
  });
}

function group(name, members, wanted) {
  const root = document.createElement("fieldset");
  const legend = document.createElement("legend");
  legend.textContent = name;
  root.append(legend, ...members.map((signal) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = wanted.has(signal.key);
    box.value = signal.key;
    box.onchange = () => {
      const full = box.checked && wanted.size >= MOST;
      put("signal-text", full ? `A plot shows ${MOST} signals at most: remove one first.` : "");
      if (full) box.checked = false;
      else if (box.checked) wanted.add(signal.key);
      else wanted.delete(signal.key);
    };
    label.title = signal.doc;
    label.append(box, ` ${signal.label}${signal.unit ? ` [${signal.unit}]` : ""}`);
    return label;
  }));
  return root;
}
