/** A gamepad as a device: both arms on two sticks, triggers for the jaws, rumble for force. */

import { atRest, axesOf, type Device, type DeviceAxis, type Reading } from "./device.ts";

const DEAD = 0.12;
/** How long one rumble lasts; a new one begins before it ends (ms). */
const RUMBLE_MS = 120;

/** Buttons and axes of the standard layout, for each arm. */
const LAYOUT = [
  { x: 0, y: 1, deeper: 12, back: 13, rollRight: 15, rollLeft: 14, trigger: 6, clutch: 4 },
  { x: 2, y: 3, deeper: 3, back: 0, rollRight: 1, rollLeft: 2, trigger: 7, clutch: 5 },
] as const;

/** Buttons that are not for an arm. */
export const ACTIONS: Record<number, "keep" | "discard" | "redo" | "hand back"> = { 9: "keep", 8: "discard", 11: "redo", 10: "hand back" };

export class GamepadDevice implements Device {
  readonly id = "gamepad";
  readonly name = "Gamepad";
  readonly hint = "Hold a shoulder button to move its arm; the stick moves it, the trigger closes its jaw.";
  readonly axes: DeviceAxis[] = [...axesOf("gamepad", 0, "Left"), ...axesOf("gamepad", 1, "Right")];
  private index: number | null = null;
  private pressed = new Set<number>();
  private rumbled = 0;

  constructor(private readonly lost: () => void, private readonly act: (action: string) => void) {
    addEventListener("gamepaddisconnected", (event) => {
      if (event.gamepad.index === this.index) this.drop();
    });
  }

  private get pad(): Gamepad | null {
    const pads = navigator.getGamepads();
    const known = this.index === null ? null : pads[this.index];
    return known?.connected ? known : (pads.find((pad) => pad?.connected) ?? null);
  }

  get present(): boolean {
    return this.pad !== null;
  }

  /** Its own name, and whether its layout is the standard one. */
  get description(): string {
    const pad = this.pad;
    if (!pad) return "No gamepad. Connect one and press a button on it.";
    return pad.mapping === "standard" ? pad.id : `${pad.id}. It has no standard layout: watch each axis in the test.`;
  }

  read(): Reading[] {
    const pad = this.pad;
    if (!pad) {
      if (this.index !== null) this.drop();
      return [atRest(), atRest()];
    }
    this.index = pad.index;
    this.readActions(pad);
    const axis = (i: number): number => shape(pad.axes[i] ?? 0);
    const button = (i: number): number => pad.buttons[i]?.value ?? 0;
    const held = (i: number): boolean => pad.buttons[i]?.pressed ?? false;
    return LAYOUT.map((at) => ({
      clutch: held(at.clutch),
      rates: {
        right: axis(at.x),
        up: -axis(at.y),
        deeper: button(at.deeper) - button(at.back),
        roll: button(at.rollRight) - button(at.rollLeft),
        jaw: 1 - 2 * button(at.trigger),
      },
      opening: 1 - button(at.trigger),
    }));
  }

  /** Rumbles with a share of the strongest, 0 to 1. */
  rumble(share: number): void {
    const now = performance.now();
    if (share < 0.02 || now - this.rumbled < RUMBLE_MS * 0.7) return;
    this.rumbled = now;
    const strong = Math.min(share, 1);
    void this.pad?.vibrationActuator
      ?.playEffect("dual-rumble", { duration: RUMBLE_MS, strongMagnitude: strong, weakMagnitude: Math.min(1, 1.5 * strong) })
      .catch(() => undefined);
  }

  clear(): void {
    this.pressed.clear();
  }

  private readActions(pad: Gamepad): void {
    for (const [at, action] of Object.entries(ACTIONS)) {
      const index = Number(at);
      const down = pad.buttons[index]?.pressed ?? false;
      if (down && !this.pressed.has(index)) this.act(action);
      if (down) this.pressed.add(index);
      else this.pressed.delete(index);
    }
  }

  private drop(): void {
    this.index = null;
    this.lost();
  }
}

/** A stick's place without its dead zone, finer near the middle. */
function shape(value: number): number {
  const size = Math.abs(value);
  if (size < DEAD) return 0;
  const live = Math.min((size - DEAD) / (1 - DEAD), 1);
  return Math.sign(value) * live * (0.4 + 0.6 * live);
}
