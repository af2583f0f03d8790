// SPDX-License-Identifier: MIT
// The connection to the server: requests with answers, news, samples. It comes back by itself.

const RETRY_MS = 500;
const HERE_MS = 250; // the server takes a page for lost that is silent for 2 s
const WINDOW = 2;

export class Socket {
  #socket = null;
  #waiting = new Map();
  #number = 0;
  #token = new URLSearchParams(location.search).get("token") ?? "";

  /** on: {open, lost, news, samples}; samples(isWindow, traces, arrived), traces: [{place, time, value}] */
  constructor(on) {
    this.on = on;
    this.#open();
    setInterval(() => this.send({ do: "here" }), HERE_MS);
  }

  get token() { return this.#token; }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket?token=${encodeURIComponent(this.#token)}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { this.#socket = socket; this.on.open(); };
    socket.onmessage = (event) => this.#receive(event.data);
    socket.onclose = () => {
      this.#socket = null;
      for (const { fail } of this.#waiting.values()) fail({ error: "the studio's server is gone", hint: "" });
      this.#waiting.clear();
      this.on.lost();
      setTimeout(() => this.#open(), RETRY_MS);
    };
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
        fail({ error: "the studio's server is gone", hint: "start omni studio again" });
      }
    });
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      this.on.samples(...unpacked(data));
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

/** Read what the server packs: [isWindow, traces, arrived]. */
export function unpacked(buffer) {
  const [kind, count] = new Uint32Array(buffer, 0, 2);
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
  return [kind === WINDOW, traces, arrived];
}
