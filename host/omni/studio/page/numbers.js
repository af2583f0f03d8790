// SPDX-License-Identifier: MIT
// Fields for numbers. A browser's own number field drops characters that it does not know: "12,5" becomes 125. These
// take what was typed as it is, and say beside the field why they do not take it.

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const DECIMAL_COMMA = /^[+-]?\d*,\d+$/;
const GROUPED = /^[+-]?[1-9]\d{0,2},\d{3}$/; // 1,500 is 1.5 to some people and 1500 to others
const FIELDS = "input.number";
const MOST_DIGITS = 15; // the last of more is lost in a number

/**
 * Read a number as it was typed: {value}, null for an empty optional field, or {problem}.
 * limits: {min, max, whole, optional}
 */
export function parse_number(text, { min = -Infinity, max = Infinity, whole = false, optional = false } = {}) {
  const typed = text.trim().replace("−", "-");
  if (typed === "") return optional ? { value: null } : { problem: "Type a number." };
  if (GROUPED.test(typed)) {
    const meant = [whole ? "" : `${typed.replace(",", ".")} or `, typed.replace(",", "")].join("");
    return { problem: `“${typed}” is ambiguous: type ${meant}.` };
  }
  const plain = DECIMAL_COMMA.test(typed) ? typed.replace(",", ".") : typed;
  const value = Number(plain);
  if (!NUMBER.test(plain) || !Number.isFinite(value)) return { problem: `“${typed}” is not a number.` };
  if (whole && !Number.isInteger(value)) return { problem: `“${typed}” is not a whole number.` };
  if (value < min || value > max) return { problem: `“${typed}” is out of range: ${range_in_words(min, max)}.` };
  return { value };
}

/** Make an input a field for a number. */
export function number_field(field, { min, max, whole = false, optional = false } = {}) {
  Object.assign(field, { type: "text", inputMode: whole ? "numeric" : "decimal", autocomplete: "off" });
  field.classList.add("number");
  field.toggleAttribute("data-whole", whole);
  field.toggleAttribute("data-optional", optional);
  if (min != null) field.dataset.min = min;
  if (max != null) field.dataset.max = max;
  return field;
}

function parsed(field) {
  const { min = -Infinity, max = Infinity, whole, optional } = field.dataset;
  const limits = { min: Number(min), max: Number(max), whole: whole !== undefined, optional: optional !== undefined };
  return parse_number(field.value, limits);
}

/** The number in a field; null: it is empty and may be; undefined: it has a problem. */
export const number_in = (field) => parsed(field).value;

/** Fill a field in place of the person; an old problem goes. */
export function fill_number(field, text) {
  field.value = text;
  check(field, true);
}

/** Whether all fields have numbers; the first that has none gets the focus, and its problem is shown. */
export function all_numbers(...fields) {
  fields.forEach((field) => check(field, true));
  const wrong = fields.filter((field) => parsed(field).problem);
  wrong[0]?.focus();
  return wrong.length === 0;
}

/** Check every field for a number while it is typed in; its problem is shown when it is left or entered. */
export function watch_numbers() {
  for (const [type, left] of [["input", false], ["change", true]]) {
    document.addEventListener(type, ({ target }) => target.matches?.(FIELDS) && check(target, left), { capture: true });
  }
  document.addEventListener("keydown", (event) => {
    const steps = { ArrowUp: 1, ArrowDown: -1 }[event.code];
    if (steps && event.target.matches?.(FIELDS)) step(event, steps);
  });
}

/** Show the problem of a field; before the field is left, only an old problem goes. */
function check(field, left) {
  const problem = parsed(field).problem ?? "";
  field.setCustomValidity(problem); // its form is not sent
  if (problem && !left) return;
  if (field.dataset.ownProblem !== undefined) return; // who set it up shows it
  field.setAttribute("aria-invalid", problem !== "");
  const place = field.closest("label") ?? field;
  let shown = place.nextElementSibling;
  if (!shown?.matches(".refusal.beside")) {
    if (!problem) return;
    shown = Object.assign(document.createElement("span"), { className: "refusal beside" });
    shown.setAttribute("role", "alert");
    place.after(shown);
  }
  shown.textContent = problem;
}

/** Change the last digit that is shown, as a browser's own number field does. */
function step(event, steps) {
  const field = event.target;
  const value = number_in(field);
  if (value == null) return;
  event.preventDefault();
  const { min = -Infinity, max = Infinity, whole } = field.dataset;
  const typed = whole === undefined ? field.value.trim().replace("−", "-").replace(",", ".") : String(value);
  const [shown, power = "0"] = typed.toLowerCase().split("e");
  if (shown.replace(/\D/g, "").length > MOST_DIGITS) return;
  const decimals = shown.split(".")[1]?.length ?? 0;
  const digits = (Number(shown) + steps * 10 ** -decimals).toFixed(decimals);
  const changed = Number(power) === 0 ? digits : `${digits}e${power}`;
  field.value = Number(changed) > max ? max : Number(changed) < min ? min : changed;
  for (const type of ["input", "change"]) field.dispatchEvent(new Event(type, { bubbles: true }));
}

function range_in_words(min, max) {
  if (max === Infinity) return `at least ${min}`;
  return min === -Infinity ? `at most ${max}` : `${min} to ${max}`;
}
