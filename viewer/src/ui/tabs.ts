/** Tabs over panels, as the keyboard expects them: arrows move, Home and End go to the ends. */

import { el } from "./dom.ts";

export interface Tab {
  id: string;
  label: string;
  panel: HTMLElement;
}

export class Tabs {
  readonly list = el("div", { class: "tabs", role: "tablist", "aria-label": "Panels" });
  readonly panels = el("div", { class: "panels" });
  private readonly buttons: HTMLButtonElement[];
  current = "";

  constructor(private readonly tabs: Tab[], private readonly changed: (id: string) => void) {
    this.buttons = tabs.map(({ id, label, panel }) => {
      panel.id = `panel-${id}`;
      panel.setAttribute("role", "tabpanel");
      panel.setAttribute("aria-labelledby", `tab-${id}`);
      this.panels.append(panel);
      const button = el(
        "button",
        { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": `panel-${id}`, "data-test": `tab-${id}` },
        label,
      );
      button.addEventListener("click", () => this.show(id));
      this.list.append(button);
      return button;
    });
    this.list.addEventListener("keydown", (event) => this.key(event));
    this.show(tabs[0]?.id ?? "");
  }

  show(id: string): void {
    this.current = id;
    this.tabs.forEach(({ id: own, panel }, i) => {
      const on = own === id;
      panel.hidden = !on;
      this.buttons[i]?.setAttribute("aria-selected", String(on));
      if (this.buttons[i]) this.buttons[i].tabIndex = on ? 0 : -1;
    });
    this.panels.scrollTop = 0;
    this.changed(id);
  }

  private key(event: KeyboardEvent): void {
    const at = this.tabs.findIndex(({ id }) => id === this.current);
    const last = this.tabs.length - 1;
    const to = { ArrowRight: at === last ? 0 : at + 1, ArrowLeft: at === 0 ? last : at - 1, Home: 0, End: last }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    this.show(this.tabs[to]!.id);
    this.buttons[to]?.focus();
  }
}
