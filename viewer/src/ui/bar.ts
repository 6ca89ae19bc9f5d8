/** The bar above: what is watched, whether the link holds, who acts. */

import type { Session } from "../wire/session.ts";
import { el, setText } from "./dom.ts";
import { title } from "./format.ts";

type State = "good" | "warn" | "bad" | "acting" | "plain";

export class Bar {
  readonly root: HTMLElement;
  private readonly name = el("h1", { "data-test": "scene-name" }, "Live view");
  private readonly summary = el("span", { class: "sub" });
  private readonly link = chip("link");
  private readonly actors = chip("actors");

  constructor(private readonly session: Session) {
    this.root = el(
      "header",
      { class: "bar" },
      el("span", { class: "mark" }, "Trocar"),
      this.name,
      this.summary,
      el("div", { class: "chips" }, this.actors, this.link),
    );
    session.connection.on("link", () => this.showLink());
    session.on("scene", () => this.showScene());
    session.on("status", () => this.showActors());
    this.showLink();
    this.showActors();
  }

  private showScene(): void {
    const header = this.session.scene?.header;
    if (!header) return;
    setText(this.name, header.name);
    setText(this.summary, `${title(header.task.name)}: ${header.task.summary}`);
    document.title = `${header.name} – Trocar`;
  }

  private showLink(): void {
    const texts = { connecting: "Connecting", open: "Connected", lost: "Connection lost", refused: "Not connected" };
    const states: Record<string, State> = { connecting: "warn", open: "good", lost: "bad", refused: "bad" };
    const { link } = this.session.connection;
    show(this.link, texts[link], states[link] ?? "plain");
  }

  private showActors(): void {
    const actors = Object.entries(this.session.status?.actors ?? {});
    const driven = actors.filter(([, actor]) => actor === "operator").map(([arm]) => arm);
    if (this.session.watches) show(this.actors, "Stepped by its own program", "plain");
    else if (driven.length > 0) show(this.actors, driven.length > 1 ? "You or a device drive both arms" : `Operator drives ${driven[0]} arm`, "acting");
    else show(this.actors, actors.some(([, a]) => a === "replay") ? "Replay" : `Policy: ${this.session.status?.policy ?? "–"}`, "plain");
  }
}

function chip(id: string): HTMLSpanElement {
  return el("span", { class: "chip", "data-test": `chip-${id}`, role: "status" }, el("i"), el("span"));
}

function show(chip: HTMLSpanElement, text: string, state: State): void {
  if (chip.lastElementChild) setText(chip.lastElementChild, text);
  if (chip.dataset["state"] !== state) chip.dataset["state"] = state;
}
