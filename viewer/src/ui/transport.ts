/** Below the view: play, step, reset; time and place in the episode; speed, wanted and measured. */

import type { Session } from "../wire/session.ts";
import { button, el, setAttribute, setText } from "./dom.ts";
import { number, seconds, speed } from "./format.ts";
import { icon } from "./icons.ts";

const SPEEDS = [0.125, 0.25, 0.5, 1, 2, 4, 8, 0];

export class Transport {
  readonly root: HTMLElement;
  private readonly play = button("", "play", () => this.togglePlay(), "square main");
  private readonly step = button("", "step", () => void this.session.ask({ type: "step", periods: 1 }), "square");
  private readonly again = button("", "reset", () => void this.session.ask({ type: "reset" }), "square");
  private readonly time = el("strong", { "data-test": "time" }, "0.00 s");
  private readonly mode = el("span", { "data-test": "mode" }, "Waiting");
  private readonly scrub = el("input", {
    type: "range", class: "scrub", min: 0, max: 1, step: "any", value: 0, "aria-label": "Time in the episode", "data-test": "scrub",
  });
  private readonly speeds = el("select", { "data-test": "speed", "aria-label": "Speed" });
  private readonly rate = el("span", { "data-test": "rate", title: "Measured speed over the last second" }, "–");
  private dragging = false;
  private seeking = false;
  private wanted: number | null = null;

  constructor(private readonly session: Session) {
    this.play.replaceChildren(icon("play"));
    this.step.replaceChildren(icon("step"));
    this.again.replaceChildren(icon("reset"));
    label(this.step, "One control period (full stop)");
    label(this.again, "Begin again with the same seed");
    this.speeds.append(...SPEEDS.map((s) => el("option", { value: s }, speed(s))));
    this.speeds.value = "1";
    this.speeds.addEventListener("change", () => void session.ask({ type: "speed", factor: Number(this.speeds.value) }));
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    this.scrub.addEventListener("pointerdown", () => (this.dragging = true));
    addEventListener("pointerup", () => (this.dragging = false));
    this.root = el(
      "footer",
      { class: "transport", "aria-label": "Playback" },
      el("div", { class: "keys" }, this.play, this.step, this.again),
      el("div", { class: "middle" }, el("div", { class: "clock" }, this.time, this.mode), this.scrub),
      el("div", { class: "speed" }, el("span", {}, "Measured"), el("span", {}, "Speed"), this.rate, this.speeds),
    );
    session.on("status", () => this.show());
    session.on("frame", () => this.showTime());
    session.on("seats", () => this.show());
    this.show();
  }

  togglePlay(): void {
    void this.session.ask({ type: this.session.status?.playing ? "pause" : "play" });
  }

  stepOnce(): void {
    void this.session.ask({ type: "step", periods: 1 });
  }

  private show(): void {
    const status = this.session.status;
    const playing = status?.playing ?? false;
    this.play.replaceChildren(icon(playing ? "pause" : "play"));
    label(this.play, playing ? "Pause (P)" : "Play (P)");
    const allowed = this.session.has("controls") && status?.phase === "ready";
    for (const control of [this.play, this.step, this.again, this.scrub, this.speeds]) control.disabled = !allowed;
    if (!status) return;
    const end = status.seekable_s > 0 ? Math.max(status.length_s, status.seekable_s) : status.length_s;
    setAttribute(this.scrub, "max", String(Math.max(end, 1e-3)));
    if (document.activeElement !== this.speeds) this.speeds.value = String(status.speed_target);
    setText(this.rate, playing ? `${number(status.speed_actual, 2)}x` : "Paused");
    setText(this.mode, modeText(status));
    this.showTime();
  }

  private showTime(): void {
    const status = this.session.status;
    const time = this.session.frame?.header.time_s ?? status?.time_s ?? 0;
    setText(this.time, seconds(time));
    if (!this.dragging && !this.seeking) this.scrub.value = String(time);
    this.scrub.setAttribute("aria-valuetext", seconds(time));
  }

  /** Seeks to where the slider is: one request at a time, always to the newest place. */
  private seek(time: number): void {
    this.wanted = time;
    if (this.seeking) return;
    this.seeking = true;
    const next = (): void => {
      const to = this.wanted;
      this.wanted = null;
      if (to === null) {
        this.seeking = false;
        return;
      }
      void this.session.ask({ type: "seek", time_s: to }).then(next);
    };
    next();
  }
}

function modeText(status: NonNullable<Session["status"]>): string {
  if (status.phase !== "ready") return status.phase === "failed" ? "Failed" : "Building";
  if (status.seeking) return "Seeking";
  if (status.mode === "ended") return status.passed ? "Ended: passed" : "Ended: not passed";
  const place = status.mode === "review" ? `Review of ${number(status.head_s, 1, "s")}` : `Live, of ${number(status.length_s, 0, "s")}`;
  if (status.mode === "review" && status.exact === false) return "Differs from the file";
  if (status.mode === "review" && status.exact === true) return `${place}, exact`;
  return place;
}

function label(control: HTMLElement, text: string): void {
  setAttribute(control, "aria-label", text);
  setAttribute(control, "title", text);
}
