// SPDX-License-Identifier: MIT
// Samples of the signals that are shown, oldest first, in memory that does not grow with the hours.

const MOST = 65536;
const GAP_S = 0.3; // a pause in a slow link's telemetry is shorter ...
const GAP_STEPS = 6; // ... or usual for it; of thinned samples, some are further apart than most
const LOOKED_AT = 64;

export class Buffer {
  time = new Float64Array(1024);
  value = new Float32Array(1024);
  count = 0;

  get latest() { return this.count ? this.value[this.count - 1] : undefined; }

  replace(time, value) {
    this.count = 0;
    this.append(time, value);
  }

  append(time, value) {
    const needed = this.count + time.length;
    if (needed > this.time.length) this.#make_room(needed);
    this.time.set(time, this.count);
    this.value.set(value, this.count);
    this.count += time.length;
  }

  #make_room(needed) {
    const kept = Math.max(0, needed > MOST ? this.count - MOST / 2 : 0);
    const size = Math.min(Math.max(2 * needed, 1024), Math.max(2 * MOST, needed));
    const time = new Float64Array(size);
    const value = new Float32Array(size);
    time.set(this.time.subarray(kept, this.count));
    value.set(this.value.subarray(kept, this.count));
    this.time = time;
    this.value = value;
    this.count -= kept;
  }

  /** The samples between two times, with one more at either side so that lines reach the edge. */
  between(begin, end) {
    const first = Math.max(0, lower(this.time, this.count, begin) - 1);
    const last = Math.min(this.count, lower(this.time, this.count, end) + 1);
    return { time: this.time.subarray(first, last), value: this.value.subarray(first, last) };
  }
}

function lower(times, count, wanted) {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Samples with a null in the middle of each gap of the telemetry: no line is to be drawn across. */
export function with_gap({ time, value }) {
  const longest = Math.max(GAP_S, GAP_STEPS * usual_step(time));
  const gaps = [];
  for (let i = 1; i < time.length; i++) if (time[i] - time[i - 1] > longest) gaps.push(i);
  if (gaps.length === 0) return { time, value };
  const found = { time: [], value: [] };
  let from = 0;
  for (const gap of [...gaps, time.length]) {
    for (let i = from; i < gap; i++) {
      found.time.push(time[i]);
      found.value.push(value[i]);
    }
    if (gap < time.length) {
      found.time.push((time[gap - 1] + time[gap]) / 2);
      found.value.push(null);
    }
    from = gap;
  }
  return found;
}

/** The median of some steps between samples [s]. */
function usual_step(time) {
  const every = Math.max(1, Math.floor(time.length / LOOKED_AT));
  const steps = [];
  for (let i = 1; i < time.length; i += every) steps.push(time[i] - time[i - 1]);
  return steps.sort((one, other) => one - other)[steps.length >> 1] ?? 0;
}

/** One time axis for several signals: [time, value, value ...], undefined where a signal has no sample. */
export function aligned(pieces) {
  if (pieces.length === 0) return [[]];
  const [{ time: first }] = pieces;
  if (pieces.every(({ time }) => alike(time, first))) return [first, ...pieces.map(({ value }) => value)];
  const times = [];
  const columns = pieces.map(() => []);
  const at = pieces.map(() => 0);
  for (;;) {
    let next = Infinity;
    for (let k = 0; k < pieces.length; k++) {
      if (at[k] < pieces[k].time.length) next = Math.min(next, pieces[k].time[at[k]]);
    }
    if (next === Infinity) return [times, ...columns];
    times.push(next);
    for (let k = 0; k < pieces.length; k++) {
      const here = at[k] < pieces[k].time.length && pieces[k].time[at[k]] === next;
      columns[k].push(here ? pieces[k].value[at[k]++] : undefined);
    }
  }
}

function alike(one, other) {
  if (one.length !== other.length) return false;
  for (let i = 0; i < one.length; i++) if (one[i] !== other[i]) return false;
  return true;
}
