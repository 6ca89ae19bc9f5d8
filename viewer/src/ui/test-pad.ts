/** A field to try the mouse on before it drives an arm. */

import type { Reading } from "../teleop/device.ts";
import { el } from "./dom.ts";

/** Distance of a drag that counts as the whole range (CSS pixels). */
const RANGE_PX = 40;

/** A pad that writes drags and turns of the wheel into `reading`. */
export function testPad(reading: Reading): HTMLElement {
  const pad = el("div", { class: "test-pad", "data-test": "test-pad" }, "Drag here, and turn the wheel here.");
  let from: { x: number; y: number } | null = null;
  let timer = 0;
  const clamp = (value: number): number => Math.max(-1, Math.min(1, value));
  pad.addEventListener("pointerdown", (event) => {
    from = { x: event.clientX, y: event.clientY };
    pad.setPointerCapture(event.pointerId);
  });
  pad.addEventListener("pointermove", (event) => {
    if (!from) return;
    reading.rates.right = clamp((event.clientX - from.x) / RANGE_PX);
    reading.rates.up = clamp((from.y - event.clientY) / RANGE_PX);
  });
  const end = (): void => {
    from = null;
    reading.rates.right = reading.rates.up = 0;
  };
  pad.addEventListener("pointerup", end);
  pad.addEventListener("pointercancel", end);
  pad.addEventListener("wheel", (event) => {
    event.preventDefault();
    reading.rates.deeper = -Math.sign(event.deltaY);
    clearTimeout(timer);
    timer = window.setTimeout(() => (reading.rates.deeper = 0), 200);
  }, { passive: false });
  return pad;
}
