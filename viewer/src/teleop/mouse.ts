/** The mouse as a device: drag a tip in the view, turn the wheel for insertion. */

import * as THREE from "three";
import { Dots } from "../overlays/dots.ts";
import { armTint, tint } from "../overlays/palette.ts";
import type { World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";
import { atRest, type Device, type DeviceAxis, type Reading } from "./device.ts";
import type { Operator } from "./operator.ts";

/** A tip is taken hold of within this distance (CSS pixels). */
const NEAR_PX = 40;
/** Insertion for each notch of the wheel, before scaling (m). */
const NOTCH_M = 0.002;

interface Drag {
  arm: number;
  pointer: number;
  plane: THREE.Plane;
  from: THREE.Vector3;
  shaft: THREE.Vector3;
  insertion: number;
  motion: THREE.Vector3;
}

export class Mouse implements Device {
  readonly id = "mouse";
  readonly name = "Mouse";
  readonly hint = "Drag the tip of an instrument in the view. The wheel inserts it while you drag.";
  readonly present = true;
  readonly axes: DeviceAxis[] = [
    { id: "mouse-right", label: "Sideways", ends: ["left", "right"], arm: 0, name: "right" },
    { id: "mouse-up", label: "Height", ends: ["down", "up"], arm: 0, name: "up" },
    { id: "mouse-deeper", label: "Wheel", ends: ["back", "deeper"], arm: 0, name: "deeper" },
  ];
  private readonly marks = new Dots(0.004, 0.8);
  /** The pad on which the axes are tested. */
  readonly tested = atRest();
  private drag: Drag | null = null;

  constructor(private readonly world: World, private readonly session: Session, private readonly operator: Operator, private readonly flipped: (axis: string) => boolean) {
    const view = world.canvas.parentElement!;
    world.scene.add(this.marks.points);
    world.update.push(() => this.mark());
    view.addEventListener("pointerdown", (event) => this.begin(event), { capture: true });
    view.addEventListener("wheel", (event) => this.wheel(event), { capture: true, passive: false });
    addEventListener("pointermove", (event) => this.moveTo(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      addEventListener(end, (event) => this.end((event as PointerEvent).pointerId));
    }
    addEventListener("contextmenu", (event) => {
      if (this.drag) event.preventDefault();
    });
  }

  /** Whether drags of tips drive arms; the tips are marked then. */
  get active(): boolean {
    return this.marks.points.visible;
  }

  set active(on: boolean) {
    this.marks.points.visible = on;
    this.world.draw();
  }

  private mark(): void {
    if (!this.active) return;
    const { session } = this;
    this.marks.set(
      session.arms.length,
      (arm, into) => into.set(session.armVector(arm, "tip_x_m", 3)),
      (arm) => tint(armTint(arm)),
    );
  }

  read(): Reading[] {
    return [this.tested, atRest()];
  }

  clear(): void {
    this.drag = null;
    Object.assign(this.tested, atRest());
  }

  /** Where an arm's tip is in the view (CSS pixels from its upper left corner). */
  tipOnScreen(arm: number): THREE.Vector2 | null {
    const tip = new THREE.Vector3().fromArray(this.session.armVector(arm, "tip_x_m", 3));
    const { x, y, z } = tip.project(this.world.mainCamera);
    const rect = this.world.mainRect;
    const place = new THREE.Vector2(rect.x + ((x + 1) / 2) * rect.width, rect.y + ((1 - y) / 2) * rect.height);
    return Number.isFinite(x) && z < 1 ? place : null;
  }

  private begin(event: PointerEvent): void {
    if (!this.active || event.button !== 0 || event.target !== this.world.canvas || this.drag) return;
    const place = this.local(event);
    const distances = this.session.arms.map((_, arm) => this.tipOnScreen(arm)?.distanceTo(place) ?? Number.POSITIVE_INFINITY);
    const arm = distances.indexOf(Math.min(...distances));
    if (!((distances[arm] ?? Number.POSITIVE_INFINITY) < NEAR_PX)) return;
    event.stopPropagation();
    this.world.canvas.focus({ preventScroll: true });
    const clutch = this.operator.press(arm, "world");
    if (!clutch) return;
    this.world.canvas.setPointerCapture(event.pointerId);
    const tip = new THREE.Vector3().fromArray(this.session.armVector(arm, "tip_x_m", 3));
    const forward = this.world.mainCamera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(forward, tip);
    const from = this.onPlane(event, plane);
    if (!from) return;
    const [, , , w = 1, i = 0, j = 0, k = 0] = clutch.anchor.pose;
    const shaft = new THREE.Vector3(1, 0, 0).applyQuaternion(new THREE.Quaternion(i, j, k, w));
    this.drag = { arm, pointer: event.pointerId, plane, from, shaft, insertion: 0, motion: new THREE.Vector3() };
  }

  private moveTo(event: PointerEvent): void {
    const { drag } = this;
    if (!drag || event.pointerId !== drag.pointer) return;
    const to = this.onPlane(event, drag.plane);
    if (!to) return;
    const motion = to.sub(drag.from);
    const camera = this.world.mainCamera;
    for (const [axis, column] of [["mouse-right", 0], ["mouse-up", 1]] as const) {
      if (!this.flipped(axis)) continue;
      const along = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, column);
      motion.addScaledVector(along, -2 * motion.dot(along));
    }
    drag.motion.copy(motion);
    this.apply(drag);
  }

  private wheel(event: WheelEvent): void {
    const { drag } = this;
    if (!drag) return;
    event.preventDefault();
    event.stopPropagation();
    const sign = this.flipped("mouse-deeper") ? 1 : -1;
    drag.insertion += sign * Math.sign(event.deltaY) * NOTCH_M;
    this.apply(drag);
  }

  private apply(drag: Drag): void {
    const clutch = this.operator.clutchOf(drag.arm);
    if (clutch) clutch.setWorld(drag.motion.clone().addScaledVector(drag.shaft, drag.insertion));
    else this.drag = null;
  }

  private end(pointer: number): void {
    if (!this.drag || pointer !== this.drag.pointer) return;
    const { arm } = this.drag;
    this.drag = null;
    this.operator.release(arm);
  }

  private local(event: MouseEvent): THREE.Vector2 {
    const box = this.world.canvas.getBoundingClientRect();
    return new THREE.Vector2(event.clientX - box.left, event.clientY - box.top);
  }

  private onPlane(event: MouseEvent, plane: THREE.Plane): THREE.Vector3 | null {
    const { x, y } = this.local(event);
    const rect = this.world.mainRect;
    const at = new THREE.Vector2((2 * (x - rect.x)) / rect.width - 1, 1 - (2 * (y - rect.y)) / rect.height);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.world.mainCamera as THREE.PerspectiveCamera);
    return ray.ray.intersectPlane(plane, new THREE.Vector3());
  }
}
