/** A gamepad at the lowest level that a page has: `navigator.getGamepads` itself. */

import type { Page } from "playwright-core";

/** Runs in the page before its own scripts. */
export const FAKE_GAMEPAD = `
  window.fakePad = { connected: true, axes: [0, 0, 0, 0], buttons: new Array(17).fill(0), rumbles: 0 };
  navigator.getGamepads = () => {
    const pad = window.fakePad;
    if (!pad.connected) return [null, null, null, null];
    return [{
      index: 0, id: "Fake gamepad (STANDARD GAMEPAD)", mapping: "standard", connected: true, timestamp: performance.now(),
      axes: pad.axes.slice(), buttons: pad.buttons.map((value) => ({ value, pressed: value > 0.5, touched: value > 0 })),
      vibrationActuator: { playEffect: (_, effect) => { if (effect.strongMagnitude > 0) pad.rumbles += 1; return Promise.resolve("complete"); } },
    }, null, null, null];
  };
`;

/** Puts a stick's axis somewhere. */
export async function stick(page: Page, axis: number, value: number): Promise<void> {
  await page.evaluate(`window.fakePad.axes[${axis}] = ${value}`);
}

/** Presses a button, or releases it. */
export async function press(page: Page, button: number, value: number): Promise<void> {
  await page.evaluate(`window.fakePad.buttons[${button}] = ${value}`);
}

/** Pulls the plug. */
export async function unplug(page: Page): Promise<void> {
  await page.evaluate("window.fakePad.connected = false");
}
