/** What stands in the view until there is something to draw, or when something is lost. */

import type { Session } from "../wire/session.ts";
import { el, setText } from "./dom.ts";

export class Cover {
  readonly root: HTMLElement;
  private readonly heading = el("h2", { "data-test": "cover" });
  private readonly text = el("p");

  constructor(private readonly session: Session, private readonly hasToken: boolean) {
    this.root = el("div", { class: "cover" }, el("div", {}, this.heading, this.text));
    session.connection.on("link", () => this.show());
    session.on("status", () => this.show());
    session.on("organs", () => this.show());
    this.show();
  }

  private show(): void {
    const { status, organs, scene } = this.session;
    const { link } = this.session.connection;
    const drawn = scene !== null && organs.length > 0;
    if (!this.hasToken) return this.say("This address has no token", "Open the address that trocar view wrote when it started. It ends in ?token= and a word.");
    if (link === "refused") return this.say("The simulator does not answer", "Start trocar view again and open the address that it writes.");
    if (status?.phase === "failed") return this.say("The scene could not be built", status.message ?? "trocar view wrote why.");
    if (drawn) {
      this.root.hidden = true;
      return;
    }
    if (link === "lost") return this.say("The connection was lost", "The page tries again.");
    if (status?.phase === "building") return this.say("Building the scene", status.message ? `The simulator is ${status.message}.` : "This takes some seconds.");
    this.say("Connecting", "The page waits for the simulator.");
  }

  private say(heading: string, text: string): void {
    this.root.hidden = false;
    setText(this.heading, heading);
    setText(this.text, text);
  }
}
