/** The axis test on the screen: a rail for each axis, whose mark moves as the arm would. */

import { AxisTest } from "../teleop/axis-test.ts";
import type { Device, Reading } from "../teleop/device.ts";
import { el, setAttribute, setText } from "./dom.ts";

export class AxisTestView {
  readonly root = el("div", { class: "axes", "data-test": "axis-test" });
  private readonly rows: { mark: HTMLElement; count: HTMLOutputElement; root: HTMLElement }[];

  constructor(readonly test: AxisTest) {
    this.rows = test.device.axes.map((axis) => {
      const mark = el("i");
      const count = el("output", {}, "0 of 2");
      const flip = el("input", { type: "checkbox", "aria-label": `Turn ${axis.label.toLowerCase()} round`, "data-test": `flip-${axis.id}` });
      flip.addEventListener("change", () => test.flip(axis, flip.checked));
      const ends = el("span", { class: "ends" }, el("span", {}, axis.ends[0]), el("span", {}, axis.ends[1]));
      const root = el(
        "div",
        { class: "axis", "data-axis": axis.id },
        el("span", {}, axis.label),
        el("span", {}, el("span", { class: "rail" }, mark), ends),
        count,
        el("label", { class: "flip", title: "Turn this axis round" }, flip, el("span", {}, "Flip")),
      );
      this.root.append(root);
      return { mark, count, root };
    });
  }

  /** Shows what the device says now. */
  show(readings: Reading[]): void {
    const values = this.test.step(readings);
    this.rows.forEach(({ mark, count, root }, i) => {
      const axis = this.test.device.axes[i]!;
      mark.style.left = `${50 + 46 * Math.max(-1, Math.min(1, values[i] ?? 0))}%`;
      const ends = this.test.ends(axis);
      setText(count, ends === 2 ? "Tested" : `${ends} of 2`);
      setAttribute(root, "data-state", ends === 2 ? "tested" : null);
    });
  }
}

/** A new test of a device. */
export function beginTest(device: Device): AxisTestView {
  return new AxisTestView(new AxisTest(device));
}
