/** One channel over time, drawn on a canvas. */

import { el, setText } from "./dom.ts";
import { channel as describe, number } from "./format.ts";

/** Most points that a plot keeps; an episode of ten minutes has 18,000. */
const MAX_POINTS = 20_000;
const MARGIN = { left: 44, right: 6, top: 6, bottom: 16 };

export class Plot {
  readonly root: HTMLElement;
  private readonly canvas = el("canvas", { role: "img" });
  private readonly now = el("b", { "data-test": "plot-value" }, "–");
  private times: number[] = [];
  private values: number[] = [];
  private dirty = true;
  private readonly unit: string;

  constructor(readonly name: string, remove: () => void) {
    const { label, unit } = describe(name);
    this.unit = unit;
    const close = el("button", { type: "button", "aria-label": `Remove the plot of ${label}`, title: "Remove", on: { click: remove } }, "×");
    this.canvas.setAttribute("aria-label", `${label} over time`);
    this.root = el(
      "figure",
      { class: "plot", "data-test": `plot-${name}` },
      el("header", {}, el("span", { title: name }, label), this.now, close),
      this.canvas,
    );
    new ResizeObserver(() => {
      this.dirty = true;
      this.draw();
    }).observe(this.canvas);
  }

  /** Points that are kept. */
  get count(): number {
    return this.times.length;
  }

  /** Replaces what is known. */
  set(times: ArrayLike<number>, values: ArrayLike<number>): void {
    this.times = Array.from(times);
    this.values = Array.from(values);
    this.dirty = true;
  }

  /** Adds the newest number; time that went back drops what was later. */
  push(time: number, value: number): void {
    while (this.times.length > 0 && this.times.at(-1)! >= time) {
      this.times.pop();
      this.values.pop();
    }
    this.times.push(time);
    this.values.push(value);
    if (this.times.length > MAX_POINTS) {
      this.times.splice(0, MAX_POINTS / 10);
      this.values.splice(0, MAX_POINTS / 10);
    }
    this.dirty = true;
  }

  draw(): void {
    if (!this.dirty || this.canvas.clientWidth === 0) return;
    this.dirty = false;
    const ratio = Math.min(devicePixelRatio, 2);
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.scale(ratio, ratio);
    const style = getComputedStyle(this.canvas);
    const color = (name: string): string => style.getPropertyValue(name).trim();
    setText(this.now, number(this.values.at(-1), decimals(this.values), this.unit));
    const finite = this.values.filter(Number.isFinite);
    const [low, high] = bounds(finite);
    const begin = this.times[0] ?? 0;
    const end = Math.max(this.times.at(-1) ?? 1, begin + 1);
    const x = (t: number): number => MARGIN.left + ((t - begin) / (end - begin)) * (width - MARGIN.left - MARGIN.right);
    const y = (v: number): number => height - MARGIN.bottom - ((v - low) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);
    context.font = "10.5px system-ui, sans-serif";
    context.textBaseline = "middle";
    for (const value of [low, (low + high) / 2, high]) {
      context.strokeStyle = color("--line");
      context.beginPath();
      context.moveTo(MARGIN.left, Math.round(y(value)) + 0.5);
      context.lineTo(width - MARGIN.right, Math.round(y(value)) + 0.5);
      context.stroke();
      context.fillStyle = color("--soft");
      context.textAlign = "right";
      context.fillText(number(value, decimals([low, high])), MARGIN.left - 6, y(value));
    }
    context.textAlign = "left";
    context.fillText(number(begin, 1, "s"), MARGIN.left, height - 6);
    context.textAlign = "right";
    context.fillText(number(end, 1, "s"), width - MARGIN.right, height - 6);
    context.strokeStyle = color(this.name.startsWith("left") ? "--left" : this.name.startsWith("right") ? "--right" : "--accent");
    context.lineWidth = 1.6;
    context.lineJoin = "round";
    context.beginPath();
    let pen = false;
    const stride = Math.max(1, Math.floor(this.times.length / (4 * width)));
    for (let i = 0; i < this.times.length; i += stride) {
      const value = this.values[i]!;
      if (!Number.isFinite(value)) {
        pen = false;
        continue;
      }
      if (pen) context.lineTo(x(this.times[i]!), y(value));
      else context.moveTo(x(this.times[i]!), y(value));
      pen = true;
    }
    context.stroke();
  }
}

function bounds(values: number[]): [number, number] {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!Number.isFinite(low)) return [0, 1];
  const pad = Math.max((high - low) * 0.05, Math.abs(high) * 1e-3, 1e-4);
  return [low === 0 ? 0 : low - pad, high + pad];
}

function decimals(values: number[]): number {
  const largest = values.reduce((most, v) => (Number.isFinite(v) ? Math.max(most, Math.abs(v)) : most), 0);
  return largest >= 100 ? 0 : largest >= 10 ? 1 : largest >= 1 ? 2 : 3;
}
