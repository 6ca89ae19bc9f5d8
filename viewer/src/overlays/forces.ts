/** Contact points with the force on tissue at each, and the force of each latched grasp at its tip. */

import * as THREE from "three";
import type { World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";
import { Arrows } from "./arrows.ts";
import { Dots } from "./dots.ts";
import { tint } from "./palette.ts";

const MAX_ARROWS = 1024;
const WIDTH = 8;

export class Forces {
  private readonly contact = new Arrows(MAX_ARROWS);
  private readonly constraint = new Arrows(8);
  private readonly dots = new Dots(0.0016, 1);

  constructor(private readonly world: World, private readonly session: Session) {
    world.scene.add(this.contact.group, this.constraint.group, this.dots.points);
    world.update.push(() => this.update());
  }

  showContact(on: boolean): void {
    this.contact.group.visible = on;
    this.dots.points.visible = on;
    this.session.subscribe({ contacts: on });
    this.world.draw();
  }

  showConstraint(on: boolean): void {
    this.constraint.group.visible = on;
    this.world.draw();
  }

  /** Contact points and arrows that are drawn. */
  get shown(): { contacts: number; arrows: number; constraints: number } {
    const contacts = this.dots.points.visible ? this.dots.points.geometry.drawRange.count : 0;
    return { contacts, arrows: this.contact.shown, constraints: this.constraint.shown };
  }

  private update(): void {
    if (this.contact.group.visible) this.updateContacts(this.session.frame?.contacts ?? new Float32Array(0));
    if (this.constraint.group.visible) this.updateConstraints();
  }

  private updateContacts(contacts: Float32Array): void {
    const color = tint("contact");
    const count = Math.floor(contacts.length / WIDTH);
    this.dots.set(count, (i, into) => into.set(contacts.subarray(WIDTH * i, WIDTH * i + 3)), () => color);
    this.contact.setColor(color);
    this.contact.begin();
    for (let i = 0; i < count; i += 1) {
      PLACE.fromArray(contacts, WIDTH * i);
      this.contact.add(PLACE, FORCE.fromArray(contacts, WIDTH * i + 3));
    }
    this.contact.end();
  }

  private updateConstraints(): void {
    this.constraint.setColor(tint("constraint"));
    this.constraint.begin();
    this.session.arms.forEach((_, arm) => {
      PLACE.fromArray(this.session.armVector(arm, "tip_x_m", 3));
      // The wire has the force of tissue on the instrument; drawn is the one on tissue.
      FORCE.fromArray(this.session.armVector(arm, "constraint_x_n", 3)).negate();
      this.constraint.add(PLACE, FORCE, 1.6);
    });
    this.constraint.end();
  }
}

const PLACE = new THREE.Vector3();
const FORCE = new THREE.Vector3();
