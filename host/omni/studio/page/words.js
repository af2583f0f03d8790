// SPDX-License-Identifier: MIT
// What every part of the page says and shows in the same way.

/** The element with this id. */
export const id = (name) => document.getElementById(name);

/** Show words in the element with this id. The same words again are left alone: a screen reader would repeat them. */
export function put(name, words) {
  if (id(name).textContent !== words) id(name).textContent = words;
}

/** A refusal of the server in words. */
export const in_words = ({ error, hint }) => (hint ? `${error}. ${hint}` : error);

/** Show each line as an item of a list. */
export function show_lines(list, lines) {
  list.replaceChildren(...lines.map((words) => {
    const item = document.createElement("li");
    item.textContent = words;
    return item;
  }));
}

/** How an axis of a plot looks, light or dark. */
export function axis_style() {
  const style = getComputedStyle(document.documentElement);
  const [text, line] = ["--quiet", "--line"].map((name) => style.getPropertyValue(name).trim());
  return { stroke: text, grid: { stroke: line, width: 0.5 }, ticks: { stroke: line } };
}
