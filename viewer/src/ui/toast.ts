/** One sentence over the view for a few seconds; screen readers say it too. */

import { el, setText } from "./dom.ts";

const SHOWN_MS = 6000;

export class Toast {
  readonly root = el("div", { class: "toast", role: "status", "aria-live": "polite", hidden: true, "data-test": "toast" });
  private timer = 0;

  say(text: string, state: "plain" | "bad" = "plain"): void {
    this.root.hidden = false;
    this.root.dataset["state"] = state;
    setText(this.root, text);
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => (this.root.hidden = true), SHOWN_MS);
  }
}
