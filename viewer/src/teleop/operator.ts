/** The operator: reads the chosen device, holds the clutches, sends commands, and lets go when anything is lost. */

import * as THREE from "three";
import type { CameraModel, Frame } from "../wire/messages.ts";
import type { Session } from "../wire/session.ts";
import { Clutch } from "./clutch.ts";
import { atRest, type Device, type Reading } from "./device.ts";
import type { AxisTest } from "./axis-test.ts";

/** How often devices are read and commands are sent (ms). */
const TICK_MS = 16;
/** A tick that comes this late means that the page stood still: the clutch is let go (ms). */
const STALLED_MS = 1000;
/** Frames that are this old are no picture to steer by (ms). */
const STALE_MS = 1000;

export interface Settings {
  frame: Frame;
  scale: number;
}

interface ArmInput {
  clutch: Clutch | null;
  /** After the clutch was let go by the page, its key must be released before it counts again. */
  blocked: boolean;
  last: Reading;
}

export class Operator {
  readonly settings: Settings = { frame: "endoscope", scale: 0.5 };
  private device: { device: Device; test: AxisTest } | null = null;
  private readonly arms: ArmInput[] = [0, 1].map(() => ({ clutch: null, blocked: false, last: atRest() }));
  private seq = 0;
  private presses = 0;
  private lastTick = performance.now();
  /** A sentence about what happened last, and how grave it is. */
  said: { text: string; state: "plain" | "good" | "warn" | "bad" } = { text: "", state: "plain" };

  constructor(
    private readonly session: Session,
    private readonly endoscope: () => CameraModel | null,
    private readonly changed: () => void,
  ) {
    setInterval(() => this.tick(), TICK_MS);
    addEventListener("blur", () => this.letGo("The window lost the focus: the arm holds its place."));
    addEventListener("pagehide", () => this.letGo("The page was left: the arm holds its place."));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.letGo("The page was hidden: the arm holds its place.");
    });
    session.connection.on("link", (link) => {
      if (link !== "open") this.letGo("The connection was lost: the arm holds its place.");
    });
  }

  /** Whether any clutch is held. */
  get clutched(): boolean {
    return this.arms.some(({ clutch }) => clutch !== null);
  }

  /** The clutch of an arm. */
  clutchOf(arm: number): Clutch | null {
    return this.arms[arm]?.clutch ?? null;
  }

  /** Drives with a device that passed its test; null: with none. */
  use(device: Device | null, test: AxisTest | null): void {
    this.letGo(null);
    device?.clear();
    this.device = device && test ? { device, test } : null;
    // A clutch that is pressed already must be released first.
    const readings = this.device ? test!.correct(device!.read()) : [];
    this.arms.forEach((input, arm) => (input.blocked = readings[arm]?.clutch ?? true));
  }

  /** The device was lost. */
  lost(name: string): void {
    const was = this.clutched;
    this.letGo(`The ${name} is gone${was ? ": the arm holds its place" : ""}.`, "bad");
  }

  /** Releases every clutch and says why. */
  letGo(why: string | null, state: "warn" | "bad" = "warn"): void {
    const held = this.clutched;
    this.arms.forEach((_, arm) => this.release(arm, true));
    this.device?.device.clear();
    if (why && (held || state === "bad")) this.say(why, state);
  }

  /** Presses an arm's clutch at where the arm is commanded to be; null where it may not be driven. */
  press(arm: number, frame: Frame = this.settings.frame): Clutch | null {
    const input = this.arms[arm];
    const name = this.session.arms[arm]?.name;
    if (!input || !name || !this.session.frame) return null;
    const refused = this.refusal(name);
    if (refused) {
      this.say(refused, "warn");
      input.blocked = true;
      return null;
    }
    const camera = this.endoscope();
    const commanded = this.session.armVector(arm, "commanded_x_m", 7);
    input.clutch = new Clutch(++this.presses, {
      pose: commanded,
      jaw: this.session.arm(arm, "commanded_4"),
      frame: frame === "endoscope" && !camera ? "world" : frame,
      camera,
      scale: this.settings.scale,
    });
    this.say(`Driving the ${name} arm.`, "good");
    return input.clutch;
  }

  release(arm: number, block = false): void {
    const input = this.arms[arm];
    const name = this.session.arms[arm]?.name;
    if (!input) return;
    if (block) input.blocked = true;
    if (!input.clutch || !name) return;
    input.clutch = null;
    this.session.connection.send({ type: "release", arm: name } as { type: string });
    this.say(`The ${name} arm holds its place.`, "plain");
  }

  /** Gives both arms back to the policy. */
  handBack(): void {
    this.letGo(null);
    for (const arm of this.session.arms) {
      if (this.session.has(arm.name)) void this.session.ask({ type: "hand_back", arm: arm.name });
    }
    this.say("The policy has the arms again.", "plain");
  }

  /** A number for the next command. */
  nextSeq(): number {
    return ++this.seq;
  }

  say(text: string, state: "plain" | "good" | "warn" | "bad"): void {
    if (text === this.said.text && state === this.said.state) return;
    this.said = { text, state };
    this.changed();
  }

  private refusal(arm: string): string | null {
    const status = this.session.status;
    if (this.session.connection.link !== "open") return "There is no connection to the simulator.";
    if (!this.session.has(arm)) return `Another operator has the ${arm} arm.`;
    if (status?.phase !== "ready") return "The scene is not ready.";
    if (status.mode === "ended") return "The episode is over. Begin again to drive.";
    if (status.mode === "review") return "This is a review. Go to the end of the episode to drive.";
    if (!status.playing) return "The simulation is paused. Press play to drive.";
    return null;
  }

  private tick(): void {
    const now = performance.now();
    const elapsed = now - this.lastTick;
    this.lastTick = now;
    if (this.clutched) this.checkStale(now, elapsed);
    if (this.device && !document.hidden) this.readDevice(elapsed / 1000);
    this.arms.forEach((input, arm) => {
      const name = this.session.arms[arm]?.name;
      if (input.clutch && name) this.session.connection.sendLatest(input.clutch.message(name, this.nextSeq()));
    });
  }

  private checkStale(now: number, elapsed: number): void {
    if (elapsed > STALLED_MS) this.letGo("The page stood still for a moment: the arm holds its place. Press the clutch again.");
    else if (now - this.session.frameAt > STALE_MS) this.letGo("No new picture for a second: the arm holds its place.");
    for (const [arm, { clutch }] of this.arms.entries()) {
      const name = this.session.arms[arm]?.name;
      const refused = clutch && name ? this.refusal(name) : null;
      if (refused) this.letGo(refused);
    }
  }

  private readDevice(dt: number): void {
    const { device, test } = this.device!;
    const readings = test.correct(device.read());
    readings.forEach((reading, arm) => {
      const input = this.arms[arm];
      if (!input) return;
      input.last = reading;
      if (!reading.clutch) {
        input.blocked = false;
        if (input.clutch) this.release(arm);
        return;
      }
      if (input.blocked) return;
      if (!input.clutch && !this.press(arm)) return;
      const tip = new THREE.Vector3().fromArray(this.session.armVector(arm, "tip_x_m", 3));
      const name = this.session.arms[arm]?.name ?? "";
      if (!input.clutch!.move(reading, Math.min(dt, 0.05), tip)) this.say(`The ${name} arm is held back.`, "warn");
      else if (!input.clutch!.hasJaw) this.say(`Driving the ${name} arm. Pull the trigger until it meets the jaw.`, "good");
      else this.say(`Driving the ${name} arm.`, "good");
    });
  }
}
