/** Driving: choose a device, test its axes, hold its clutch; hand back, keep, discard. */

import type { World } from "../scene/world.ts";
import type { Device } from "../teleop/device.ts";
import { GamepadDevice } from "../teleop/gamepad.ts";
import { Keyboard } from "../teleop/keyboard.ts";
import { Mouse } from "../teleop/mouse.ts";
import { Operator } from "../teleop/operator.ts";
import type { Frame } from "../wire/messages.ts";
import type { Session } from "../wire/session.ts";
import { ActionSliders } from "./action-sliders.ts";
import { beginTest, type AxisTestView } from "./axis-test-view.ts";
import { button, el, select, setAttribute, setText, slider } from "./dom.ts";
import { number, title } from "./format.ts";
import { keysOf } from "./key-table.ts";
import { RecordBox, type RecordAction } from "./record-box.ts";
import { testPad } from "./test-pad.ts";

export class DrivePanel {
  readonly root = el("div", { class: "panel" });
  readonly operator: Operator;
  private readonly devices: Device[];
  private readonly keyboard: Keyboard;
  readonly mouse: Mouse;
  private readonly gamepad: GamepadDevice;
  private readonly sliders: ActionSliders;
  private readonly record: RecordBox;
  private readonly tests = new Map<string, AxisTestView>();
  private readonly passed = new Set<string>();
  private readonly note = el("p", { class: "note", role: "status", "data-test": "drive-note" });
  private readonly hint = el("p", { "data-test": "drive-hint" });
  private readonly testHost = el("div", { class: "stack" });
  private readonly use = button("Drive with it", "use-device", () => this.useDevice(), "main");
  private readonly again = button("Test again", "test-again", () => this.testAgain());
  private readonly handBack = button("Hand back to the policy", "hand-back", () => this.operator.handBack());
  private readonly keys = el("div", { class: "keys-table" });
  private readonly delay = el("output", { "data-test": "latency" }, "–");
  private readonly armChoice: ReturnType<typeof select>;
  private readonly chooser: ReturnType<typeof select>;
  private chosen = "";

  constructor(private readonly session: Session, world: World, private readonly toast: (text: string, state?: "plain" | "bad") => void) {
    const endoscope = () => session.scene?.header.cameras.find((camera) => camera.endoscope) ?? null;
    this.operator = new Operator(session, endoscope, () => this.showNote());
    this.keyboard = new Keyboard(world.canvas, () => this.showArm());
    this.mouse = new Mouse(world, session, this.operator, (axis) => this.tests.get("mouse")?.test.isFlipped(axis) ?? false);
    this.gamepad = new GamepadDevice(() => this.lostGamepad(), (action) => this.act(action));
    this.devices = [this.keyboard, this.mouse, this.gamepad];
    this.sliders = new ActionSliders(session, () => this.operator.nextSeq(), (text) => this.operator.say(text, "warn"));
    this.record = new RecordBox(session, world.canvas);
    this.chooser = select(
      "Device", "device",
      [["", "None"], ["keyboard", "Keyboard"], ["mouse", "Mouse"], ["gamepad", "Gamepad"], ["sliders", "Sliders"]],
      (id) => this.choose(id),
    );
    const frame = select(
      "Directions of", "frame",
      [["endoscope", "Endoscope"], ["tool", "Tool"], ["world", "Cell"]],
      (value) => (this.operator.settings.frame = value as Frame),
    );
    const scale = slider(
      "Scale of motion", "scale",
      { min: 0.1, max: 1, step: 0.05, value: this.operator.settings.scale, text: (v) => v.toFixed(2) },
      (value) => (this.operator.settings.scale = value),
    );
    this.armChoice = select("Keys move", "key-arm", [["0", "Left arm"], ["1", "Right arm"]], (arm) => {
      this.keyboard.arm = Number(arm);
      this.operator.letGo(null);
    });
    this.sliders.root.hidden = true;
    this.root.append(
      el("h2", {}, "Operator"),
      el("div", { class: "stack" }, this.chooser.root, this.note, this.hint, this.testHost, el("div", { class: "row" }, this.use, this.again, this.handBack)),
      this.sliders.root,
      el("h2", {}, "Motion"),
      el("div", { class: "stack" }, this.armChoice.root, frame.root, scale.root),
      el("div", { class: "line" }, el("span", {}, "Command to picture"), this.delay),
      this.keys,
      el("h2", {}, "Demonstration"),
      this.record.root,
    );
    setInterval(() => this.tick(), 33);
    session.on("hello", () => {
      if (session.watches) this.root.replaceChildren(el("p", {}, "The program that steps the environment moves the arms. This page watches."));
      else this.choose("");
    });
    session.on("frame", () => {
      setText(this.delay, number(session.latencyMs, 0, "ms"));
      this.rumble();
    });
    session.on("status", () => this.showButtons());
    session.on("seats", () => this.showButtons());
    world.canvas.addEventListener("keydown", (event) => {
      if (event.code === "KeyH" && !event.repeat && !event.ctrlKey && !event.metaKey) this.operator.handBack();
    });
    this.choose("");
  }

  /** Whether a clutch is held: the keys of the view are the device's then. */
  get clutched(): boolean {
    return this.operator.clutched || (this.chosen === "keyboard" && this.keyboard.clutch);
  }

  /** The panel is shown or hidden; a test runs only while it is seen. */
  setShown(on: boolean): void {
    this.keyboard.testing = on && this.chosen === "keyboard" && !this.passed.has("keyboard");
  }

  private get device(): Device | undefined {
    return this.devices.find((device) => device.id === this.chosen);
  }

  private choose(id: string): void {
    this.chosen = id;
    this.chooser.input.value = id;
    this.operator.use(null, null);
    this.sliders.stop();
    this.mouse.active = false;
    this.sliders.root.hidden = id !== "sliders";
    const arms = this.session.arms.map((arm) => arm.name);
    if (id && arms.length > 0) void this.takeSeats(arms);
    else if (arms.some((arm) => this.session.has(arm))) void this.session.ask({ type: "seats", take: [], give: arms });
    const { device } = this;
    this.testHost.replaceChildren();
    if (device && !this.passed.has(id)) this.showTest(device);
    else if (device) this.drive(device);
    this.keyboard.testing = id === "keyboard" && !this.passed.has(id);
    if (!id) this.operator.say("Choose a device to take the instruments in your own hands.", "plain");
    if (id === "sliders") this.operator.say("Move a slider; the arm goes there at its own speed.", "plain");
    this.showArm();
    this.showButtons();
  }

  private async takeSeats(arms: string[]): Promise<void> {
    const taken = arms.filter((arm) => this.session.taken(arm));
    const free = arms.filter((arm) => !this.session.taken(arm));
    const ok = free.length === 0 || (await this.session.ask({ type: "seats", take: free, give: [] }));
    if (taken.length > 0) this.operator.say(`Another operator has the ${taken.join(" and the ")} arm.`, "warn");
    else if (!ok) this.operator.say("The arms could not be taken.", "bad");
  }

  private showTest(device: Device): void {
    let view = this.tests.get(device.id);
    if (!view) this.tests.set(device.id, (view = beginTest(device)));
    this.testHost.replaceChildren(view.root);
    this.use.disabled = !view.test.done;
    if (device === this.mouse) this.testHost.prepend(testPad(this.mouse.tested));
    this.operator.say("Move each axis both ways. The marks move as the arm will; flip an axis that goes the wrong way.", "plain");
  }

  private useDevice(): void {
    const { device } = this;
    if (!device || !this.tests.get(device.id)?.test.done) return;
    this.passed.add(device.id);
    this.keyboard.testing = false;
    this.testHost.replaceChildren();
    this.drive(device);
    this.showButtons();
  }

  private drive(device: Device): void {
    const test = this.tests.get(device.id)?.test;
    if (!test) return;
    this.operator.use(device === this.mouse ? null : device, test);
    this.mouse.active = device === this.mouse;
    this.operator.say("Ready. The arms move only while the clutch is held.", "good");
  }

  private testAgain(): void {
    const { device } = this;
    if (!device) return;
    this.passed.delete(device.id);
    this.tests.delete(device.id);
    this.choose(device.id);
  }

  private lostGamepad(): void {
    this.operator.lost("gamepad");
    this.passed.delete("gamepad");
    this.tests.delete("gamepad");
    if (this.chosen === "gamepad") {
      this.toast("The gamepad is gone. The arms hold their place.", "bad");
      this.operator.use(null, null);
      const gone = this.devices.find((device) => device.id === "gamepad");
      if (gone) this.showTest(gone);
      this.operator.say("The gamepad is gone. Connect it and test it again.", "bad");
    }
    this.showButtons();
  }

  private act(action: string): void {
    if (this.chosen !== "gamepad" || !this.passed.has("gamepad")) return;
    if (action === "hand back") this.operator.handBack();
    else void this.record.act(action as RecordAction);
  }

  private tick(): void {
    const { device } = this;
    const view = this.tests.get(this.chosen);
    if (!device || !view || this.passed.has(this.chosen)) return;
    view.show(device.read());
    this.use.disabled = !view.test.done;
    setText(this.hint, this.hintOf(device));
  }

  private rumble(): void {
    if (this.chosen !== "gamepad" || !this.operator.clutched) return;
    const limit = this.session.scene?.header.force_limit_n ?? 10;
    const forces = this.session.arms.map((_, arm) =>
      this.operator.clutchOf(arm) ? Math.hypot(...this.session.armVector(arm, "contact_x_n", 3)) + Math.hypot(...this.session.armVector(arm, "constraint_x_n", 3)) : 0,
    );
    // Tissue is soft: a tenth of the limit is already much, so the square root of the share.
    this.gamepad.rumble(Math.sqrt(Math.max(...forces, 0) / limit));
  }

  private hintOf(device: Device): string {
    if (device === this.gamepad && (!this.gamepad.present || !this.passed.has("gamepad"))) return this.gamepad.description;
    return device.hint;
  }

  private showArm(): void {
    this.armChoice.root.hidden = this.chosen !== "keyboard";
    this.armChoice.input.value = String(this.keyboard.arm);
    const rows = keysOf(this.chosen);
    this.keys.hidden = rows.length === 0;
    this.keys.replaceChildren(
      ...rows.flatMap(([keys, text]) => [el("span", {}, ...keys.map((key) => el("kbd", {}, key))), el("span", {}, text)]),
    );
  }

  private showButtons(): void {
    const testing = Boolean(this.device) && !this.passed.has(this.chosen);
    this.use.hidden = !testing;
    this.again.hidden = !this.device || testing;
    const actors = this.session.status?.actors ?? {};
    const mine = this.session.arms.filter((arm) => this.session.has(arm.name) && ["operator", "hold"].includes(actors[arm.name] ?? ""));
    this.handBack.hidden = mine.length === 0;
    this.hint.hidden = !this.device;
    if (this.device) setText(this.hint, this.hintOf(this.device));
    this.showNote();
  }

  private showNote(): void {
    const { text, state } = this.operator.said;
    setText(this.note, text);
    setAttribute(this.note, "data-state", state === "plain" ? null : state);
    setAttribute(this.root, "data-driving", this.operator.clutched ? "true" : null);
    setAttribute(this.root, "aria-label", `Drive${this.device ? ` with the ${title(this.device.id)}` : ""}`);
  }
}
