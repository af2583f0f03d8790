// SPDX-License-Identifier: MIT
// The connection to the server: requests with answers, news, samples. It comes back by itself.

const RETRY_MS = 500;
const HERE_MS = 250; // the server takes a page for lost that is silent for 2 s
const MOST_UNANSWERED = 20; // the page takes a server for lost that leaves so many without an answer: 5 s
export const [MORE, WHOLE, PART] = [1, 2, 3]; // what came since, all that is kept, what lies between two times

const GONE = { error: "the studio's server does not respond", hint: "Start omni studio again" };

export class Socket {
  #socket = null; // once it is open
  #unanswered = 0; // how often the page has said that it lives, and heard nothing
  #waiting = new Map();
  #number = 0;
  #token = new URLSearchParams(location.search).get("token") ?? "";

  /**
   * on: {open, lost, news, samples}; lost gets how many requests were left without an answer, samples what `unpacked`
   * returns.
   */
  constructor(on) {
    this.on = on;
    this.#open();
    setInterval(() => this.#here(), HERE_MS);
  }

  get token() { return this.#token; }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket?token=${encodeURIComponent(this.#token)}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#socket = socket;
      this.#unanswered = 0;
      this.on.open();
    };
    socket.onmessage = (event) => {
      this.#unanswered = 0;
      this.#receive(event.data);
    };
    socket.onclose = () => this.#lose(socket);
  }

  /**
   * Tell the server that this page lives. A network that was cut, or a server that hangs, closes nothing. What counts
   * is how often, not how long: a page that was busy has answers waiting behind this call.
   */
  #here() {
    if (this.#socket && this.#unanswered >= MOST_UNANSWERED) this.#lose(this.#socket);
    else if (this.send({ do: "here" })) this.#unanswered += 1;
  }

  #lose(socket) {
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    this.#socket = null;
    const unfinished = this.#waiting.size;
    for (const { fail } of this.#waiting.values()) fail(GONE);
    this.#waiting.clear();
    setTimeout(() => this.on.lost(unfinished)); // after those who waited have said so
    setTimeout(() => this.#open(), RETRY_MS);
  }

  /** Send and forget; false if there is no server. */
  send(request) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify(request));
    return true;
  }

  /** Send and wait for the answer; rejects with {error, hint}. */
  ask(action, content = {}) {
    return new Promise((done, fail) => {
      const id = ++this.#number;
      this.#waiting.set(id, { done, fail });
      if (!this.send({ do: action, id, ...content })) {
        this.#waiting.delete(id);
        fail(GONE);
      }
    });
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      this.on.samples(unpacked(data));
      return;
    }
    const message = JSON.parse(data);
    if (!("answer" in message)) {
      this.on.news(message);
      return;
    }
    const waiting = this.#waiting.get(message.answer);
    this.#waiting.delete(message.answer);
    if (message.error) waiting?.fail(message);
    else waiting?.done(message.result);
  }
}

/** Read what the server packs: {kind, number, traces: [{place, time, value}], arrived}. */
export function unpacked(buffer) {
  const [kind, number] = new Uint16Array(buffer, 0, 2); // of the list of signals that was asked for
  const [count] = new Uint32Array(buffer, 4, 1);
  const traces = [];
  const [arrived] = new Float64Array(buffer, 8, 1); // at the server [s since 1970]
  let at = 16;
  for (let i = 0; i < count; i++) {
    const [place, n] = new Uint32Array(buffer, at, 2);
    const time = new Float64Array(buffer, at + 8, n);
    const value = new Float32Array(buffer, at + 8 + 8 * n, n);
    at += 8 + 8 * n + Math.ceil((4 * n) / 8) * 8;
    traces.push({ place, time, value });
  }
  return { kind, number, traces, arrived };
}
