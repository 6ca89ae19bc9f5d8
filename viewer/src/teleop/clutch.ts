/** One arm's clutch: from press to release, the whole motion since the press and the jaw. */

import * as THREE from "three";
import type { CameraModel, Frame, Pose, ServoRelative } from "../wire/messages.ts";
import type { Reading } from "./device.ts";

/** Speed of a hand at full deflection, before scaling (m/s), of its roll (rad/s), of its jaw (1/s). */
const SPEED_M_S = 0.08;
const ROLL_RAD_S = 1.2;
const JAW_PER_S = 0.9;
/** The wanted place runs at most this far ahead of the measured one (m). */
const AHEAD_M = 0.03;
/** A trigger takes the jaw once it is this near to the jaw's opening. */
const PICK_UP = 0.06;

/** Where the arm is when the clutch is pressed. */
export interface Anchor {
  /** Commanded pose of the tip. */
  pose: Pose;
  /** Commanded opening of the jaw. */
  jaw: number;
  frame: Frame;
  camera: CameraModel | null;
  scale: number;
}

export class Clutch {
  /** Motion since the press in the frame's axes, before scaling (m). */
  readonly translation = new THREE.Vector3();
  private roll = 0;
  private jaw: number;
  private picked = false;
  private lastGap: number | null = null;
  /** Turns the frame's axes into the cell's. */
  private readonly axes: THREE.Quaternion;
  private readonly start: THREE.Vector3;
  private readonly shaft: THREE.Vector3;

  constructor(readonly number: number, readonly anchor: Anchor) {
    const [x = 0, y = 0, z = 0, w = 1, i = 0, j = 0, k = 0] = anchor.pose;
    this.start = new THREE.Vector3(x, y, z);
    const tool = new THREE.Quaternion(i, j, k, w);
    const [, , , cw = 1, ci = 0, cj = 0, ck = 0] = anchor.camera?.pose ?? [];
    this.axes =
      anchor.frame === "tool" ? tool.clone() : anchor.frame === "endoscope" ? new THREE.Quaternion(ci, cj, ck, cw) : new THREE.Quaternion();
    this.shaft = new THREE.Vector3(1, 0, 0).applyQuaternion(tool).applyQuaternion(this.axes.clone().invert());
    this.jaw = anchor.jaw;
  }

  /** Moves on by what a device says, for `dt` seconds; `tip` is the measured tip. False: the arm is too far behind. */
  move(reading: Reading, dt: number, tip: THREE.Vector3): boolean {
    const { rates } = reading;
    const before = this.ahead(tip);
    const step = direction(this.anchor.frame, rates.right, rates.up, rates.deeper).multiplyScalar(SPEED_M_S * dt);
    this.translation.add(step);
    const free = !(this.ahead(tip) > AHEAD_M && this.ahead(tip) > before);
    if (!free) this.translation.sub(step);
    this.roll += rates.roll * ROLL_RAD_S * dt;
    if (reading.opening === null) this.jaw = THREE.MathUtils.clamp(this.jaw + rates.jaw * JAW_PER_S * dt, 0, 1);
    else this.follow(reading.opening);
    return free;
  }

  /** Sets the motion since the press, given in the cell's axes. */
  setWorld(motion: THREE.Vector3): void {
    this.translation.copy(motion).applyQuaternion(this.axes.clone().invert());
  }

  message(arm: string, seq: number): ServoRelative {
    const { anchor, translation: t } = this;
    const turn = new THREE.Quaternion().setFromAxisAngle(this.shaft, this.roll);
    return {
      type: "servo_cr", arm, seq, time_s: performance.now() / 1000, clutch: this.number, frame: anchor.frame,
      ...(anchor.frame === "endoscope" && anchor.camera ? { camera: anchor.camera.name } : {}),
      scale: anchor.scale, translation_m: [t.x, t.y, t.z], rotation_wxyz: [turn.w, turn.x, turn.y, turn.z], jaw: this.jaw,
    };
  }

  /** Whether a trigger has met the jaw, or there is none. */
  get hasJaw(): boolean {
    return this.picked || this.lastGap === null;
  }

  /** How far the wanted tip is from the measured one (m). */
  private ahead(tip: THREE.Vector3): number {
    return this.translation.clone().applyQuaternion(this.axes).multiplyScalar(this.anchor.scale).add(this.start).distanceTo(tip);
  }

  /** The jaw follows a trigger once the trigger met it, so that a press of the clutch drops nothing. */
  private follow(opening: number): void {
    const gap = opening - this.jaw;
    if (Math.abs(gap) < PICK_UP || (this.lastGap !== null && gap * this.lastGap < 0)) this.picked = true;
    this.lastGap = gap;
    if (this.picked) this.jaw = THREE.MathUtils.clamp(opening, 0, 1);
  }
}

/** A hand's motion in the axes of a frame. */
export function direction(frame: Frame, right: number, up: number, deeper: number): THREE.Vector3 {
  // The endoscope's: x right, y down, z away. The tool's: x along the blades. The cell's: x right, y away, z up.
  if (frame === "endoscope") return new THREE.Vector3(right, -up, deeper);
  if (frame === "tool") return new THREE.Vector3(deeper, -right, up);
  return new THREE.Vector3(right, deeper, up);
}
