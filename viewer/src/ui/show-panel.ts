/** The overlays: one switch each, and the legend over the view that explains those that are on. */

import type { Forces } from "../overlays/forces.ts";
import type { Nodes } from "../overlays/nodes.ts";
import type { Rcm } from "../overlays/rcm.ts";
import type { Bodies } from "../scene/bodies.ts";
import type { Cameras } from "../scene/cameras.ts";
import type { Organs } from "../scene/organs.ts";
import { RAMP_CSS } from "../scene/ramp.ts";
import type { ValueKind } from "../wire/messages.ts";
import type { Session } from "../wire/session.ts";
import { el, select, setText, toggle } from "./dom.ts";
import { number } from "./format.ts";

interface Parts {
  organs: Organs;
  bodies: Bodies;
  cameras: Cameras;
  forces: Forces;
  nodes: Nodes;
  rcm: Rcm;
}

const LEGENDS: Record<string, { color: string; text: string }[]> = {
  contact: [{ color: "var(--contact)", text: "Contact, force on tissue (1 cm is 0.2 N)" }],
  constraint: [{ color: "var(--constraint)", text: "Grasp, force on tissue (1 cm is 0.2 N)" }],
  held: [{ color: "var(--left)", text: "Held, left arm" }, { color: "var(--right)", text: "Held, right arm" }],
  pins: [{ color: "var(--soft)", text: "Pinned" }],
  rcm: [
    { color: "var(--good)", text: "Where the shaft crosses the port" },
    { color: "var(--warn)", text: "3 mm" },
    { color: "var(--bad)", text: "5 mm" },
  ],
  cameras: [{ color: "#0b9a92", text: "Cameras" }],
};

export class ShowPanel {
  readonly root = el("div", { class: "panel" });
  readonly legend = el("div", { class: "legend", "data-test": "legend", hidden: true });
  private readonly on = new Set<string>();
  private readonly low = el("span");
  private readonly high = el("span");
  private readonly rampName = el("span");
  private value: ValueKind | null = null;

  constructor(private readonly session: Session, private readonly parts: Parts) {
    const { organs, bodies, cameras, forces, nodes, rcm } = parts;
    const value = select(
      "Colour tissue by", "value",
      [["", "Recorded colours"], ["stretch", "Stretch"], ["energy", "Strain energy"]],
      (kind) => this.showValue(kind === "" ? null : (kind as ValueKind)),
    );
    this.root.append(
      el("h2", {}, "Tissue"),
      value.root,
      toggle("See-through organs", "transparent", false, (on) => organs.setTransparent(on)),
      this.toggle("pins", "Pins", "Nodes that are held where they were recorded", (on) => nodes.showPins(on)),
      this.toggle("held", "What the jaws hold", "Nodes of each grasp", (on) => nodes.showHeld(on)),
      el("h2", {}, "Forces"),
      this.toggle("contact", "Contact", "Points where something presses on tissue, with arrows", (on) => forces.showContact(on)),
      this.toggle("constraint", "Constraint", "What a latched grasp pulls with, at the tip", (on) => forces.showConstraint(on)),
      el("h2", {}, "Ports and cameras"),
      this.toggle("rcm", "RCM deviation", "Rings at the task's limit and where the hardware stops", (on) => rcm.show(on)),
      this.toggle("cameras", "Cameras", "What each camera sees", (on) => cameras.showFrustums(on)),
      el("h2", {}, "Hide"),
      toggle("Arms", "hide-arms", false, (on) => {
        for (const part of ["link", "motor"]) bodies.show(part, !on);
      }),
      toggle("Instruments", "hide-instruments", false, (on) => {
        for (const part of ["shaft", "blade"]) bodies.show(part, !on);
      }),
      toggle("Ports and wall", "hide-wall", false, (on) => {
        for (const part of ["ports", "wall", "holders"]) bodies.show(part, !on);
      }),
    );
    session.on("frame", () => this.showRange());
    session.on("scene", () => this.showLegend());
  }

  private toggle(id: string, label: string, hint: string, change: (on: boolean) => void): HTMLElement {
    return toggle(label, `show-${id}`, false, (on) => {
      if (on) this.on.add(id);
      else this.on.delete(id);
      change(on);
      this.showLegend();
    }, hint);
  }

  private showValue(kind: ValueKind | null): void {
    this.value = kind;
    this.session.subscribe({ value: kind });
    this.showLegend();
  }

  private showRange(): void {
    const value = this.session.frame?.header.value;
    if (!value || !this.value) return;
    const decimals = value.kind === "stretch" ? 2 : 0;
    setText(this.low, number(value.low, decimals));
    setText(this.high, `${number(value.high, decimals)}${value.unit ? ` ${value.unit}` : ""}`);
    setText(this.rampName, value.kind === "stretch" ? "Stretch" : "Energy");
  }

  private showLegend(): void {
    const limits = this.session.scene?.header.rcm_mm;
    const lines = [...this.on].flatMap((id) => LEGENDS[id] ?? []).map(({ color, text }) => {
      const mark = el("i");
      mark.style.background = color;
      const said = text === "3 mm" ? `${limits?.threshold ?? 3} mm` : text === "5 mm" ? `${limits?.abort ?? 5} mm` : text;
      return el("div", {}, mark, el("span", {}, said));
    });
    if (this.value) {
      const bar = el("i", { class: "ramp" });
      bar.style.background = RAMP_CSS;
      lines.unshift(el("div", {}, this.rampName, this.low, bar, this.high));
      this.showRange();
    }
    this.legend.replaceChildren(...lines);
    this.legend.hidden = lines.length === 0;
  }

  /** What the overlays draw; for tests. */
  get drawn(): Record<string, unknown> {
    const { forces, nodes, rcm, cameras } = this.parts;
    return { ...forces.shown, ...nodes.shown, crossings: rcm.group.visible ? rcm.crossings : [], frustums: cameras.list.length };
  }
}
