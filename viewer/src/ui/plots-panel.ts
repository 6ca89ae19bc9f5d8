/** Live plots of any channel: what was recorded so far, then each new period. */

import { Binary } from "../wire/binary.ts";
import type { Session } from "../wire/session.ts";
import { el, select } from "./dom.ts";
import { channel as describe } from "./format.ts";
import { Plot } from "./plot.ts";

const FIRST = ["lift_mm", "left_jaw_force_n", "left_rcm_mm"];
const MAX_PLOTS = 12;

export class PlotsPanel {
  readonly root = el("div", { class: "panel" });
  private readonly list = el("div", { "data-test": "plots" });
  private readonly chooser = select("Add a channel", "channel", [], (name) => {
    this.chooser.input.value = "";
    if (name) this.addPlot(name);
  });
  private plots: Plot[] = [];
  private scene = -1;
  private step = -1;
  private known = "";

  constructor(private readonly session: Session) {
    this.root.append(el("h2", {}, "Channels"), this.chooser.root, el("div", { class: "spacer" }), this.list);
    session.on("scene", () => this.fill());
    session.on("frame", () => this.push());
    session.on("status", () => this.reload());
    const draw = (): void => {
      requestAnimationFrame(draw);
      if (!this.root.hidden) for (const plot of this.plots) plot.draw();
    };
    draw();
  }

  private fill(): void {
    const header = this.session.scene?.header;
    if (!header) return;
    const names = header.channels.filter((name) => name !== "time_s");
    const text = (name: string): string => {
      const { label, unit } = describe(name);
      return unit ? `${label} (${unit})` : label;
    };
    this.chooser.set([["", "Choose"], ...names.map((name): [string, string] => [name, text(name)])], "");
    if (this.scene === -1) for (const name of FIRST) if (names.includes(name)) this.addPlot(name);
    this.scene = header.scene;
    this.plots.filter((plot) => !names.includes(plot.name)).forEach((plot) => this.remove(plot));
    void this.load(this.plots);
  }

  private addPlot(name: string): void {
    if (this.plots.length >= MAX_PLOTS || this.plots.some((plot) => plot.name === name)) return;
    const plot: Plot = new Plot(name, () => this.remove(plot));
    this.plots.push(plot);
    this.list.append(plot.root);
    void this.load([plot]);
  }

  private remove(plot: Plot): void {
    this.plots = this.plots.filter((other) => other !== plot);
    plot.root.remove();
  }

  /** Loads again what was recorded where another episode or another review began. */
  private reload(): void {
    const status = this.session.status;
    if (!status) return;
    const known = `${status.scene} ${status.seed} ${status.policy} ${status.mode === "review"}`;
    if (known === this.known) return;
    this.known = known;
    void this.load(this.plots);
  }

  private async load(plots: Plot[]): Promise<void> {
    if (plots.length === 0 || this.session.connection.link !== "open") return;
    const names = plots.map((plot) => plot.name);
    try {
      const reply = await this.session.connection.request({ type: "history", channels: names, from_s: 0 });
      if (!(reply instanceof Binary) || !reply.has("time")) return;
      const time = reply.f32("time");
      const rows = reply.f32("rows");
      plots.forEach((plot, k) => {
        plot.set(time, time.map((_, r) => rows[r * names.length + k] ?? Number.NaN));
      });
    } catch (error) {
      this.session.emit("problem", error instanceof Error ? error.message : String(error));
    }
  }

  private push(): void {
    const frame = this.session.frame;
    if (!frame?.row || frame.header.step === this.step) return;
    this.step = frame.header.step;
    const time = this.session.channel("time_s");
    for (const plot of this.plots) plot.push(time, this.session.channel(plot.name));
  }
}
