/** The task: how the episode runs, its stages with their gates, and the readings of both arms. */

import type { Session } from "../wire/session.ts";
import { button, el, select, setAttribute, setText } from "./dom.ts";
import { number, seconds, sentence, title } from "./format.ts";
import { withThresholds } from "./thresholds.ts";

interface Row {
  root: HTMLLIElement;
  sign: HTMLSpanElement;
  time: HTMLSpanElement;
  bar: HTMLElement;
}

interface Reading {
  label: string;
  decimals: number;
  unit: string;
  value: (arm: number) => number;
  state?: (value: number) => "warn" | "bad" | null;
}

export class TaskPanel {
  readonly root = el("div", { class: "panel" });
  private readonly stages = el("ol", { class: "gates", "data-test": "gates" });
  private readonly outcome = el("p", { class: "note", "data-test": "outcome" }, "No episode yet.");
  private readonly readings = el("table", { class: "readings", "data-test": "readings" });
  private readonly seed = el("input", { type: "number", id: "seed", min: 0, step: 1, value: 0, "data-test": "seed" });
  private readonly policy = select("Policy", "policy", [], () => undefined);
  private readonly begin = button("Begin again", "begin", () => this.reset());
  private rows: Row[] = [];
  private known: { seed: number; policy: string } = { seed: 0, policy: "" };
  private cells: { reading: Reading; arm: number; cell: HTMLTableCellElement }[] = [];

  constructor(private readonly session: Session) {
    this.root.append(
      el("h2", {}, "Episode"),
      el(
        "div",
        { class: "stack" },
        this.policy.root,
        el("div", { class: "field" }, el("label", { for: "seed" }, "Seed"), el("div", { class: "row" }, el("span", { class: "grow" }, this.seed), this.begin)),
        this.outcome,
      ),
      el("h2", {}, "Stages"),
      this.stages,
      el("h2", {}, "Arms"),
      this.readings,
    );
    this.seed.style.width = "100%";
    session.on("hello", () => this.fillPolicies());
    session.on("scene", () => this.build());
    session.on("status", () => this.showStatus());
    session.on("seats", () => this.showStatus());
    session.on("frame", () => this.showFrame());
    this.showStatus();
  }

  private fillPolicies(): void {
    const names = this.session.hello?.policies ?? [];
    this.policy.set(names.map((name) => [name, name === "operator" ? "Operator (you)" : title(name)]), this.session.status?.policy);
  }

  private reset(): void {
    const seed = Number.parseInt(this.seed.value, 10);
    void this.session.ask({ type: "reset", ...(Number.isSafeInteger(seed) && seed >= 0 ? { seed } : {}), policy: this.policy.input.value });
  }

  private build(): void {
    const header = this.session.scene?.header;
    if (!header) return;
    this.rows = header.stages.map((stage, i) => {
      const sign = el("span", { class: "sign", "aria-hidden": "true" }, String(i + 1));
      const time = el("span", { class: "time" });
      const bar = el("i");
      bar.style.transform = "scaleX(0)";
      const bound = withThresholds(stage.when, header.gates);
      const root = el(
        "li",
        { class: "gate", "data-state": "waiting", "data-stage": stage.name },
        sign, el("span", { class: "name" }, title(stage.name)), time, el("span", { class: "bound" }, bound),
        el("span", { class: "bar-meter" }, bar),
      );
      return { root, sign, time, bar };
    });
    this.stages.replaceChildren(...this.rows.map(({ root }) => root));
    this.buildReadings();
  }

  private buildReadings(): void {
    const { session } = this;
    const header = session.scene!.header;
    const length = (arm: number, column: string): number => Math.hypot(...session.armVector(arm, column, 3));
    const at = (column: string) => (arm: number): number => session.arm(arm, column);
    const limit = header.force_limit_n ?? Number.POSITIVE_INFINITY;
    const pressed = (n: number): "warn" | "bad" | null => (n >= limit ? "bad" : n >= limit / 2 ? "warn" : null);
    const rcm = (mm: number): "warn" | "bad" | null => (mm >= header.rcm_mm.abort ? "bad" : mm >= header.rcm_mm.threshold ? "warn" : null);
    const holds = (column: string) => (arm: number): number =>
      session.arm(arm, "held_organ") >= 0 ? session.arm(arm, column) : Number.NaN;
    const readings: Reading[] = [
      { label: "Contact force", decimals: 2, unit: "N", value: (arm) => length(arm, "contact_x_n"), state: pressed },
      { label: "Constraint force", decimals: 2, unit: "N", value: (arm) => length(arm, "constraint_x_n"), state: pressed },
      { label: "Force on the jaws", decimals: 2, unit: "N", value: at("jaw_force_n") },
      { label: "Jaw opening", decimals: 2, unit: "", value: at("jaw") },
      { label: "RCM deviation", decimals: 2, unit: "mm", value: at("rcm_mm"), state: rcm },
      { label: "RCM, peak", decimals: 2, unit: "mm", value: at("rcm_peak_mm"), state: rcm },
      { label: "Follow ratio", decimals: 2, unit: "", value: holds("follow") },
      { label: "Slip", decimals: 2, unit: "mm", value: holds("slip_mm") },
    ];
    this.cells = [];
    const side = (i: number): string => (i === 0 ? "arm-left" : "arm-right");
    const text = (label: string, test: string): HTMLTableRowElement =>
      el("tr", {}, el("th", { scope: "row" }, label), ...header.arms.map((arm) => el("td", { "data-test": `${test}-${arm.name}` }, "–")));
    this.readings.replaceChildren(
      el("colgroup", {}, el("col"), ...header.arms.map(() => el("col"))),
      el("thead", {}, el("tr", {}, el("td"), ...header.arms.map((arm, i) => el("th", { scope: "col", class: side(i) }, title(arm.name))))),
      el(
        "tbody", {}, text("Driven by", "actor"), text("Holds", "holds"),
        ...readings.map((reading) => {
          const row = el("tr", {}, el("th", { scope: "row" }, reading.label));
          header.arms.forEach((arm, index) => {
            const cell = el("td", { "data-test": `${reading.label.toLowerCase().replace(/[^a-z]+/g, "-")}-${arm.name}` }, "–");
            this.cells.push({ reading, arm: index, cell });
            row.append(cell);
          });
          return row;
        }),
      ),
    );
  }

  private showStatus(): void {
    const status = this.session.status;
    const allowed = this.session.has("controls") && status?.phase === "ready";
    for (const control of [this.policy.input, this.seed, this.begin]) control.disabled = !allowed;
    if (status?.phase !== "ready") return;
    // What the user chose for the next episode stays until another one begins.
    if (status.seed !== this.known.seed) this.seed.value = String(status.seed);
    if (status.policy !== this.known.policy) this.policy.input.value = status.policy;
    this.known = { seed: status.seed, policy: status.policy };
    const score = status.score === undefined ? "" : ` Score ${number(status.score, 2)}.`;
    if (status.note) this.say(sentence(status.note), "warn");
    else if (status.end) this.say(`${sentence(status.end.text)}${score}`, status.passed ? "good" : "bad");
    else this.say(`Running for ${seconds(status.head_s)} of ${number(status.length_s, 0, "s")}.${score}`, null);
    for (const [arm, actor] of Object.entries(status.actors ?? {})) {
      const cell = this.readings.querySelector(`[data-test="actor-${CSS.escape(arm)}"]`);
      if (cell) setText(cell, title(actor));
    }
  }

  private say(text: string, state: string | null): void {
    setText(this.outcome, text);
    setAttribute(this.outcome, "data-state", state);
  }

  private showFrame(): void {
    const frame = this.session.frame;
    if (!frame) return;
    let open = true;
    this.rows.forEach((row, i) => {
      const passed = (frame.stages[3 * i] ?? 0) > 0;
      const share = frame.stages[3 * i + 1] ?? 0;
      const at = frame.stages[3 * i + 2] ?? -1;
      const state = passed ? "passed" : open ? "open" : "waiting";
      if (!passed) open = false;
      setAttribute(row.root, "data-state", state);
      setText(row.sign, passed ? "✓" : String(i + 1));
      setText(row.time, passed ? `Passed at ${number(at, 1, "s")}` : `${Math.round(100 * share)}%`);
      row.bar.style.transform = `scaleX(${passed ? 1 : Math.min(Math.max(share, 0), 1)})`;
    });
    for (const { reading, arm, cell } of this.cells) {
      const value = reading.value(arm);
      setText(cell, number(value, reading.decimals, reading.unit));
      setAttribute(cell, "data-state", reading.state?.(value) ?? null);
    }
    this.session.arms.forEach((arm, index) => {
      const organ = this.session.arm(index, "held_organ");
      const cell = this.readings.querySelector(`[data-test="holds-${CSS.escape(arm.name)}"]`);
      if (cell) setText(cell, organ >= 0 ? title(this.session.organs[organ]?.name ?? "tissue") : "Nothing");
    });
  }
}
