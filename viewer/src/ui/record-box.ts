/** Keep, discard or redo a demonstration. Nothing is kept by itself. */

import type { Session } from "../wire/session.ts";
import { button, el, setAttribute, setText } from "./dom.ts";

export type RecordAction = "keep" | "discard" | "redo";

export class RecordBox {
  readonly root = el("div", { class: "stack" });
  private readonly text = el("p", { class: "note", "data-test": "record-note" });
  private readonly buttons: HTMLButtonElement[];
  private kept = 0;
  private last = "";
  private busy = false;

  constructor(private readonly session: Session, canvas: HTMLElement) {
    this.buttons = [
      button("Keep", "keep", () => void this.act("keep"), "main"),
      button("Discard", "discard", () => void this.act("discard")),
      button("Redo", "redo", () => void this.act("redo")),
    ];
    ["Keep this episode and begin the next seed (Enter)", "Begin the next seed (Delete)", "The same seed again (Backspace)"].forEach(
      (text, i) => setAttribute(this.buttons[i]!, "title", text),
    );
    this.root.append(this.text, el("div", { class: "row" }, ...this.buttons));
    canvas.addEventListener("keydown", (event) => {
      const action = ({ Enter: "keep", NumpadEnter: "keep", Delete: "discard", Backspace: "redo" } as const)[event.code];
      if (!action || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      void this.act(action);
    });
    session.on("hello", () => this.show());
    session.on("status", () => this.show());
    session.on("seats", () => this.show());
    this.show();
  }

  get allowed(): boolean {
    return Boolean(this.session.hello?.record) && this.session.has("controls") && this.session.status?.phase === "ready" && !this.busy;
  }

  async act(action: RecordAction): Promise<void> {
    if (!this.allowed) return;
    this.busy = true;
    this.show();
    try {
      const reply = await this.session.connection.request({ type: "record", action });
      if (!("header" in reply) && action === "keep") {
        this.kept += 1;
        const passed = reply["passed"] === true ? "It passed." : "It did not pass.";
        this.last = `Kept as ${String(reply["path"] ?? "").split("/").at(-1)}. ${passed}`;
      } else this.last = action === "redo" ? "The same seed again." : "Discarded.";
    } catch (error) {
      this.last = error instanceof Error ? error.message : String(error);
    }
    this.busy = false;
    this.show();
  }

  private show(): void {
    const folder = this.session.hello?.record;
    for (const control of this.buttons) control.disabled = !this.allowed;
    if (!folder) setText(this.text, "Nothing is recorded. Start trocar view with --record and a folder to keep demonstrations.");
    else setText(this.text, this.last ? `${this.last} ${this.kept} kept so far.` : "This episode is kept only if you press Keep.");
  }
}
