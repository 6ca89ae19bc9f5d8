/** Tools over the view: the first view again, fly to something, save a picture, make a film. */

import * as THREE from "three";
import { Film } from "../capture/film.ts";
import { savePicture } from "../capture/picture.ts";
import type { Organs } from "../scene/organs.ts";
import type { World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";
import { button, el, setAttribute } from "./dom.ts";
import { title } from "./format.ts";
import { icon } from "./icons.ts";

/** How far round a port or a tip the view is when it is flown to (m). */
const PORT_SIZE_M = 0.014;
const TIP_SIZE_M = 0.05;

export class ViewTools {
  readonly root: HTMLElement;
  private readonly target = el("select", { "aria-label": "Fly to", "data-test": "fly" });
  private readonly filmButton = button("", "film", () => this.toggleFilm());
  private readonly film: Film;

  constructor(
    private readonly world: World,
    private readonly organs: Organs,
    private readonly session: Session,
    private readonly say: (text: string, state?: "plain" | "bad") => void,
  ) {
    this.film = new Film(world.canvas, say);
    const home = button("", "home", () => world.showHome());
    home.append(icon("home"));
    named(home, "The first view (Home)");
    this.target.addEventListener("change", () => {
      this.flyTo(this.target.value);
      this.target.value = "";
    });
    const picture = button("", "picture", () => void this.savePicture());
    picture.append(icon("picture"));
    named(picture, "Save a picture of the view");
    this.filmButton.append(icon("film"));
    this.showFilm();
    this.root = el(
      "div",
      { class: "view-tools" },
      el("div", { class: "tool-group" }, home, this.target),
      el("div", { class: "tool-group" }, picture, this.filmButton),
    );
    session.on("organs", () => this.fill());
    this.fill();
  }

  private fill(): void {
    const header = this.session.scene?.header;
    const group = (label: string, entries: [string, string][]): HTMLOptGroupElement =>
      el("optgroup", { label }, ...entries.map(([value, text]) => el("option", { value }, text)));
    this.target.replaceChildren(
      el("option", { value: "" }, "Fly to"),
      group("Organs", [["organ:", "All organs"], ...this.organs.names.map((n): [string, string] => [`organ:${n}`, title(n)])]),
      group("Instruments", (header?.arms ?? []).map((arm, i): [string, string] => [`tip:${i}`, `${title(arm.name)} tip`])),
      group("Ports", (header?.ports ?? []).map((port, i): [string, string] => [`port:${i}`, `${title(port.name)} port`])),
    );
    this.target.value = "";
  }

  private flyTo(value: string): void {
    const [kind, name = ""] = value.split(":", 2);
    const around = (place: number[], size: number): THREE.Box3 =>
      new THREE.Box3().setFromCenterAndSize(new THREE.Vector3().fromArray(place), new THREE.Vector3(size, size, size));
    if (kind === "organ") this.world.flyTo(this.organs.bounds(name || undefined));
    const port = kind === "port" ? this.session.scene?.header.ports[Number(name)] : undefined;
    if (port) this.world.flyTo(around(port.centre_m, PORT_SIZE_M), new THREE.Vector3().fromArray(port.normal).add(new THREE.Vector3(0, -0.5, 0)));
    if (kind === "tip") this.world.flyTo(around(this.session.armVector(Number(name), "tip_x_m", 3), TIP_SIZE_M));
  }

  private async savePicture(): Promise<void> {
    const name = await savePicture(this.world, this.session);
    this.say(name ? `Saved ${name}.` : "The browser gave no picture.", name ? "plain" : "bad");
  }

  private toggleFilm(): void {
    if (this.film.running) this.film.stop(this.session.scene?.header.name ?? "trocar");
    else this.film.start();
    this.showFilm();
  }

  private showFilm(): void {
    this.filmButton.replaceChildren(icon(this.film.running ? "stop" : "film"));
    setAttribute(this.filmButton, "aria-pressed", String(this.film.running));
    named(this.filmButton, this.film.running ? "End the film and save it" : "Film the view");
    this.filmButton.disabled = !Film.supported;
    if (!Film.supported) named(this.filmButton, "This browser cannot record films");
  }
}

function named(control: HTMLElement, text: string): void {
  setAttribute(control, "aria-label", text);
  setAttribute(control, "title", text);
}
