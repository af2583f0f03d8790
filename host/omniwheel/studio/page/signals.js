// SPDX-License-Identifier: MIT
// The dialog in which the signals of a plot are chosen.

const MOST = 12;

/** Show the list; resolves with the chosen keys once the dialog is closed. */
export function chooseSignals(signals, chosen) {
  const dialog = document.getElementById("signal-dialog");
  const list = document.getElementById("signal-list");
  const search = document.getElementById("signal-search");
  const wanted = new Set(chosen);
  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = (signal) => words.every((word) => `${signal.key} ${signal.label} ${signal.doc}`.toLowerCase().includes(word));
    const groups = Map.groupBy(signals.filter(fits), (signal) => signal.group);
    list.replaceChildren(...[...groups].map(([name, members]) => group(name, members, wanted)));
  };
  search.value = "";
  search.oninput = show;
  show();
  dialog.showModal();
  search.focus();
  document.getElementById("close-signals").onclick = () => dialog.close();
  return new Promise((done) => {
    dialog.onclose = () => done(signals.map(({ key }) => key).filter((key) => wanted.has(key)));
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
      if (box.checked && wanted.size >= MOST) box.checked = false;
      else if (box.checked) wanted.add(signal.key);
      else wanted.delete(signal.key);
    };
    label.title = signal.doc;
    label.append(box, ` ${signal.label}${signal.unit ? ` [${signal.unit}]` : ""}`);
    return label;
  }));
  return root;
}
