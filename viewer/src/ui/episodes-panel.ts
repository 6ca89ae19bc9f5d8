/** Episodes of a campaign or of a folder of demonstrations, failures first; a click opens one. */

import type { Session } from "../wire/session.ts";
import { button, el, setText } from "./dom.ts";
import { number, title } from "./format.ts";

export class EpisodesPanel {
  readonly root = el("div", { class: "panel" });
  private readonly heading = el("h2", {}, "Episodes");
  private readonly lead = el("p", { "data-test": "episodes-lead" });
  private readonly body = el("tbody", { "data-test": "episodes" });
  private readonly live = button("Back to the live scene", "live", () => void this.session.ask({ type: "live" }));
  private readonly table: HTMLElement;

  constructor(private readonly session: Session) {
    const head = el("tr", {}, ...["Episode", "Outcome", "Score", "Time"].map((text) => el("th", { scope: "col" }, text)));
    this.table = el("div", { class: "table-wrap" }, el("table", { class: "list" }, el("thead", {}, head), this.body));
    this.root.append(this.heading, this.lead, this.table, el("div", { class: "row" }, this.live));
    session.on("hello", () => {
      session.connection.send({ type: "table" });
      this.show();
    });
    session.on("table", () => this.show());
    session.on("seats", () => this.show());
    session.on("status", () => (this.live.hidden = session.status?.mode !== "review" || !session.table?.open));
    this.show();
  }

  private show(): void {
    const table = this.session.table;
    const episodes = table?.episodes ?? [];
    this.live.hidden = !table?.open;
    this.table.hidden = episodes.length === 0;
    setText(this.heading, table?.kind === "demonstrations" ? "Demonstrations" : "Episodes");
    if (episodes.length === 0) {
      setText(this.lead, "There is no campaign here. Start trocar view with a campaign's folder to choose among its episodes.");
      if (table?.kind === "demonstrations") setText(this.lead, "No demonstration is kept yet. Drive the arms, then press Keep.");
    } else {
      const failed = episodes.filter((episode) => !episode.passed).length;
      setText(this.lead, `${failed} of ${episodes.length} did not pass. These come first. Choose one to watch it.`);
    }
    const allowed = this.session.has("controls");
    this.body.replaceChildren(
      ...episodes.map((episode) => {
        const open = el(
          "button",
          { type: "button", title: episode.why ?? "Watch this episode", disabled: !allowed, "data-episode": episode.id },
          `${title(episode.policy)} ${episode.seed}`,
        );
        open.addEventListener("click", () => void this.session.ask({ type: "open", episode: episode.id }));
        const outcome = episode.passed ? "Passed" : title(episode.end);
        return el(
          "tr",
          { class: table?.open === episode.id ? "current" : "", "aria-current": table?.open === episode.id ? "true" : null },
          el("td", {}, open),
          el("td", { class: episode.passed ? "state-good" : "state-bad" }, outcome),
          el("td", {}, number(episode.score, 2)),
          el("td", {}, number(episode.duration_s, 1, "s")),
        );
      }),
    );
  }
}
