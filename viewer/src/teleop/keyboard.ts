/** Keys as a device: one arm at a time, moved at a steady rate while the clutch key is held. */

import { atRest, axesOf, type AxisName, type Device, type DeviceAxis, type Reading } from "./device.ts";

/** Keys by their place on the keyboard, whatever the layout writes there. */
const KEYS: Record<string, [AxisName, number]> = {
  KeyD: ["right", 1], KeyA: ["right", -1], KeyW: ["up", 1], KeyS: ["up", -1], KeyE: ["deeper", 1], KeyQ: ["deeper", -1],
  KeyL: ["roll", 1], KeyJ: ["roll", -1], KeyI: ["jaw", 1], KeyK: ["jaw", -1],
};
export const CLUTCH_KEY = "Space";
const ARM_KEYS: Record<string, number> = { Digit1: 0, Digit2: 1 };

export class Keyboard implements Device {
  readonly id = "keyboard";
  readonly name = "Keyboard";
  readonly hint = "Click the view, then hold Space and press the keys below.";
  readonly present = true;
  readonly axes: DeviceAxis[] = axesOf("keyboard", 0, "");
  /** The arm that the keys move. */
  arm = 0;
  private readonly down = new Set<string>();
  /** Keys that went down since the last reading: a tap counts even between two readings. */
  private readonly tapped = new Set<string>();
  /** Whether the clutch key went up since the last reading: that counts, too, if it is down again. */
  private lifted = false;
  /** While the axis test runs, keys count wherever the focus is. */
  testing = false;

  constructor(canvas: HTMLElement, private readonly changed: () => void) {
    addEventListener("keydown", (event) => {
      const inView = document.activeElement === canvas;
      const typing = event.target instanceof Element && event.target.matches("input[type=number], select, textarea");
      if (event.ctrlKey || event.metaKey || event.altKey || !(inView || (this.testing && !typing))) return;
      if (inView && ARM_KEYS[event.code] !== undefined) {
        this.arm = ARM_KEYS[event.code]!;
        this.clear();
        this.changed();
      }
      if (event.code !== CLUTCH_KEY && !(event.code in KEYS)) return;
      if (event.code === CLUTCH_KEY && !inView) return;
      event.preventDefault();
      if (event.repeat) return;
      this.down.add(event.code);
      if (event.code !== CLUTCH_KEY) this.tapped.add(event.code);
    });
    addEventListener("keyup", (event) => {
      this.down.delete(event.code);
      if (event.code === CLUTCH_KEY) this.lifted = true;
    });
    canvas.addEventListener("blur", () => this.clear());
  }

  read(): Reading[] {
    const reading = atRest();
    reading.clutch = this.clutch && !this.lifted;
    this.lifted = false;
    for (const code of new Set([...this.down, ...this.tapped])) {
      const key = KEYS[code];
      if (key) reading.rates[key[0]] += key[1];
    }
    this.tapped.clear();
    if (this.testing) return [reading, atRest()];
    return this.arm === 0 ? [reading, atRest()] : [atRest(), reading];
  }

  /** Whether the clutch key is held. */
  get clutch(): boolean {
    return this.down.has(CLUTCH_KEY);
  }

  clear(): void {
    this.down.clear();
    this.tapped.clear();
  }
}
