// SPDX-License-Identifier: MIT
// Driving by a gamepad: the left stick drives, the right one turns, the right button of the four stops.
// Axes and buttons as in the "standard gamepad" of the W3C.

const POLL_MS = 20;
const DEAD_ZONE = 0.12; // sticks do not rest at zero
const STOP_BUTTON = 1;
const [LEFT_X, LEFT_Y, RIGHT_X] = [0, 1, 2];

export class Gamepad {
  #timer = null;
  #stopping = false;
  #driving = false;
  #mustRest = true; // what was held before arming, or through a stop, moves nothing

  constructor(velocity, on) {
    this.velocity = velocity;
    this.on = on; // {stop(), found(text)}
    document.addEventListener("visibilitychange", () => document.hidden && this.#rest(""));
  }

  /** Nothing is driven until the sticks have rested once. */
  mustRest() { this.#mustRest = true; }

  enable(on) {
    this.mustRest();
    clearInterval(this.#timer);
    this.#timer = on ? setInterval(() => this.#look(), POLL_MS) : null;
    if (!on) this.#rest("");
  }

  #look() {
    const pad = [...navigator.getGamepads()].find((found) => found?.connected && found.mapping === "standard");
    if (!pad) {
      this.#rest("press a button of the gamepad");
      return;
    }
    const pressed = pad.buttons[STOP_BUTTON]?.pressed ?? false;
    if (pressed && !this.#stopping) this.on.stop();
    this.#stopping = pressed;
    const [x, y, turn] = [-pad.axes[LEFT_Y], -pad.axes[LEFT_X], -pad.axes[RIGHT_X]].map(beyond_dead_zone);
    const resting = x === 0 && y === 0 && turn === 0;
    if (resting) this.#mustRest = false;
    if (this.#mustRest && !resting) this.#rest("release the sticks first");
    else if (pressed || document.hidden || resting) this.#rest(pad.id);
    else this.#drive([x, y, turn]);
  }

  #drive(direction) {
    this.#driving = true;
    this.velocity.hold(() => direction);
  }

  #rest(words) {
    if (this.#driving) this.velocity.letGo(); // not what the keys hold
    this.#driving = false;
    this.on.found(words);
  }
}

function beyond_dead_zone(value) {
  const size = Math.min(1, Math.max(0, (Math.abs(value) - DEAD_ZONE) / (1 - DEAD_ZONE)));
  return Math.sign(value) * size || 0; // a stick that says NaN rests
}
