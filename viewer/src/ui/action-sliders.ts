/** Sliders for the numbers of an action: a moved slider is a target until the arm is there. */

import type { Session } from "../wire/session.ts";
import { el, setText, slider } from "./dom.ts";
import { number, title } from "./format.ts";

const SEND_MS = 33;
/** A target that is not reached in this time is given up (ms). */
const LIVES_MS = 4000;
/** A target is reached within this share of the slider's range. */
const REACHED = 0.01;

interface Target {
  values: number[];
  until: number;
}

export class ActionSliders {
  readonly root = el("div", { class: "stack", "data-test": "sliders" });
  private sliders: ReturnType<typeof slider>[][] = [];
  private readonly targets = new Map<number, Target>();

  constructor(private readonly session: Session, private readonly nextSeq: () => number, private readonly say: (text: string) => void) {
    session.on("scene", () => this.build());
    session.on("frame", () => this.follow());
    setInterval(() => this.send(), SEND_MS);
  }

  /** Ends all motions that sliders began. */
  stop(): void {
    for (const arm of this.targets.keys()) this.finish(arm);
  }

  private build(): void {
    this.targets.clear();
    this.sliders = [];
    this.root.replaceChildren();
    this.session.arms.forEach((arm, index) => {
      this.root.append(el("h2", { class: index === 0 ? "arm-left" : "arm-right" }, `${title(arm.name)} arm`));
      this.sliders.push(
        arm.numbers.map((name, k) => {
          const [low, high] = [arm.low[k] ?? -1, arm.high[k] ?? 1];
          const angle = /pivot|roll/.test(name);
          const length = !angle && !/jaw/.test(name);
          const text = (v: number): string =>
            angle ? number((v * 180) / Math.PI, 1, "°") : length ? number(v * 1000, 1, "mm") : number(v, 2);
          const made = slider(
            title(name), `slider-${arm.name}-${k}`,
            { min: low, max: high, step: (high - low) / 400, value: (low + high) / 2, text },
            () => this.moved(index),
          );
          made.input.addEventListener("change", () => this.moved(index));
          this.root.append(made.root);
          return made;
        }),
      );
    });
  }

  private moved(arm: number): void {
    const name = this.session.arms[arm]?.name ?? "";
    if (!this.session.has(name)) return;
    if (!this.session.status?.playing) this.say("The simulation is paused. Press play to move the arm.");
    const sliders = this.sliders[arm] ?? [];
    this.targets.set(arm, { values: sliders.map(({ input }) => Number(input.value)), until: performance.now() + LIVES_MS });
  }

  private send(): void {
    for (const [arm, target] of this.targets) {
      const header = this.session.arms[arm];
      if (!header || !this.session.has(header.name)) {
        this.targets.delete(arm);
        continue;
      }
      const there = target.values.every((value, k) => {
        const range = (header.high[k] ?? 1) - (header.low[k] ?? 0);
        return Math.abs(value - this.session.arm(arm, `measured_${k}`)) < REACHED * range;
      });
      if (there || performance.now() > target.until || document.hidden) {
        this.finish(arm);
        continue;
      }
      this.session.connection.sendLatest({
        type: "servo_jp", arm: header.name, seq: this.nextSeq(), time_s: performance.now() / 1000, positions: target.values,
      } as { type: string });
    }
  }

  private finish(arm: number): void {
    this.targets.delete(arm);
    const name = this.session.arms[arm]?.name;
    if (name) this.session.connection.send({ type: "release", arm: name } as { type: string });
  }

  /** Sliders of an arm that is not being moved by them show where the arm is. */
  private follow(): void {
    if (this.root.hidden || !this.root.isConnected) return;
    this.sliders.forEach((sliders, arm) => {
      const free = this.session.has(this.session.arms[arm]?.name ?? "");
      const moving = this.targets.has(arm);
      sliders.forEach(({ input, set, root }, k) => {
        if (input.disabled === free) input.disabled = !free;
        const value = this.session.arm(arm, `measured_${k}`);
        if (!moving && Number.isFinite(value) && !input.matches(":active")) set(value);
        const output = root.querySelector("output");
        if (output && !Number.isFinite(value)) setText(output, "–");
      });
    });
  }
}
