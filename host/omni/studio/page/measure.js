// SPDX-License-Identifier: MIT
// What a stretch of signals amounts to: the numbers beside a plot of which a stretch was chosen with the mouse.

/** Return a sentence for each signal: {label, unit, time, value}, between two times. */
export function measured(pieces, begin, end) {
  return pieces.map(({ label, unit, time, value }) => {
    let [least, largest, sum, squares, count, first, last] = [Infinity, -Infinity, 0, 0, 0, NaN, NaN];
    for (let i = 0; i < time.length; i++) {
      if (time[i] < begin || time[i] > end) continue;
      if (count === 0) first = value[i];
      last = value[i];
      least = Math.min(least, value[i]);
      largest = Math.max(largest, value[i]);
      sum += value[i];
      squares += value[i] * value[i];
      count += 1;
    }
    if (count === 0) return `${label}: no samples`;
    const mean = sum / count;
    const deviation = Math.sqrt(Math.max(0, squares / count - mean * mean));
    const words = (number) => Number(number.toPrecision(4));
    const in_unit = unit ? ` ${unit}` : "";
    return `${label}: ${words(least)} to ${words(largest)}${in_unit}, mean ${words(mean)} ± ${words(deviation)}, `
      + `change ${words(last - first)}`;
  });
}
