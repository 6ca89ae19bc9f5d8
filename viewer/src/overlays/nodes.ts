/** Nodes that do not move by themselves: those that jaws hold, and pins. */

import type { World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";
import { Dots } from "./dots.ts";
import { armTint, tint } from "./palette.ts";

const WIDTH = 4;

export class Nodes {
  private readonly held = new Dots(0.0018, 1);
  private readonly pins = new Dots(0.0011, 0.85);

  constructor(private readonly world: World, private readonly session: Session) {
    world.scene.add(this.held.points, this.pins.points);
    session.on("organs", () => this.placePins());
    world.update.push(() => this.update());
  }

  showHeld(on: boolean): void {
    this.held.points.visible = on;
    this.session.subscribe({ held: on });
    this.world.draw();
  }

  showPins(on: boolean): void {
    this.pins.points.visible = on;
    if (on) this.placePins();
    this.world.draw();
  }

  get shown(): { held: number; pins: number } {
    const count = (dots: Dots): number => (dots.points.visible ? dots.points.geometry.drawRange.count : 0);
    return { held: count(this.held), pins: count(this.pins) };
  }

  private placePins(): void {
    const places = this.session.organs.flatMap((organ) => Array.from(organ.pins));
    const color = tint("soft");
    this.pins.set(places.length / 3, (i, into) => into.set(places.slice(3 * i, 3 * i + 3)), () => color);
  }

  private update(): void {
    if (!this.held.points.visible) return;
    const held = this.session.frame?.held ?? new Float32Array(0);
    const colors = [tint(armTint(0)), tint(armTint(1))];
    this.held.set(
      Math.floor(held.length / WIDTH),
      (i, into) => into.set(held.subarray(WIDTH * i, WIDTH * i + 3)),
      (i) => colors[held[WIDTH * i + 3] === 0 ? 0 : 1]!,
    );
  }
}
