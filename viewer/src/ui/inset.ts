/** The small canvas: what a camera of the scene sees, drawn by the page, or its ray-traced picture. */

import type { Cameras } from "../scene/cameras.ts";
import type { World } from "../scene/world.ts";
import { Binary } from "../wire/binary.ts";
import type { Session } from "../wire/session.ts";
import { button, el, setText } from "./dom.ts";
import { icon } from "./icons.ts";

/** Width of a ray-traced picture (pixels). */
const TRACED_WIDTH = 640;

export class Inset {
  readonly root: HTMLElement;
  readonly canvas = el("canvas", { "data-test": "endoscope", role: "img", "aria-label": "What the camera sees" });
  private readonly chooser = el("select", { "data-test": "camera", "aria-label": "Camera of the small picture" });
  private readonly traced = el("img", { alt: "Ray-traced picture", "data-test": "traced", hidden: true });
  private readonly caption = el("figcaption", { "data-test": "camera-caption", hidden: true });
  private readonly trace: HTMLButtonElement;
  private readonly traceText = el("span");
  private readonly swap: HTMLButtonElement;
  private address: string | null = null;

  constructor(private readonly world: World, private readonly cameras: Cameras, private readonly session: Session) {
    this.trace = button("", "ray-trace", () => void this.toggleTraced());
    this.trace.append(icon("ray"), this.traceText);
    this.label("Ray trace");
    this.trace.title = "Ask the simulator for the ray-traced picture of this camera";
    this.swap = button("", "swap", () => this.swapViews());
    this.swap.append(icon("expand"));
    this.swap.title = "Look through this camera in the large view";
    this.swap.setAttribute("aria-label", this.swap.title);
    this.swap.setAttribute("aria-pressed", "false");
    this.root = el(
      "section",
      { class: "inset", "aria-label": "Camera" },
      el("header", {}, this.chooser, this.trace, this.swap),
      el("figure", { class: "picture" }, this.canvas, this.traced, this.caption),
    );
    this.chooser.addEventListener("change", () => this.choose());
    session.on("scene", () => this.fill());
    world.before.push(() => this.draw());
    new ResizeObserver(() => world.draw()).observe(this.canvas);
  }

  private get camera() {
    return this.cameras.named(this.chooser.value) ?? this.cameras.endoscope;
  }

  private fill(): void {
    const kept = this.chooser.value;
    this.chooser.replaceChildren(
      ...this.cameras.list.map(({ model }) => el("option", { value: model.name }, name(model.name))),
    );
    const first = this.cameras.named(kept) ?? this.cameras.endoscope;
    if (first) this.chooser.value = first.model.name;
    this.showTraced(null);
    if (this.world.through) this.world.through = this.camera ?? null;
    this.choose();
  }

  private choose(): void {
    this.showTraced(null);
    if (this.world.through && this.camera) this.world.through = this.camera;
    const camera = this.camera;
    const circle = camera?.model.circle;
    const aspect = camera ? camera.model.width / camera.model.height : 16 / 9;
    this.canvas.style.clipPath = circle && !this.world.through ? `ellipse(${(50 * circle) / aspect}% ${50 * circle}% at 50% 50%)` : "";
    this.world.draw();
  }

  private swapViews(): void {
    this.world.through = this.world.through ? null : (this.camera ?? null);
    this.swap.setAttribute("aria-pressed", String(this.world.through !== null));
    this.world.controls.enabled = this.world.through === null;
    this.choose();
  }

  private draw(): void {
    const camera = this.camera;
    const context = this.canvas.getContext("2d");
    if (!context || !camera || !this.traced.hidden) return;
    const { x: maxWidth, y: maxHeight } = this.world.size;
    const width = Math.min(this.canvas.clientWidth, maxWidth);
    const height = Math.min(this.canvas.clientHeight, maxHeight);
    if (width < 2 || height < 2) return;
    const ratio = this.world.renderer.getPixelRatio();
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== w) this.canvas.width = w;
    if (this.canvas.height !== h) this.canvas.height = h;
    this.world.drawFrom(this.world.through ? null : camera, 0, 0, width, height);
    const source = this.world.renderer.domElement;
    context.drawImage(source, 0, source.height - h, w, h, 0, 0, w, h);
  }

  private async toggleTraced(): Promise<void> {
    if (!this.traced.hidden) return this.showTraced(null);
    const camera = this.camera;
    if (!camera) return;
    this.trace.disabled = true;
    this.label("Tracing");
    try {
      const { name: from, width, height } = camera.model;
      const scaled = Math.min(TRACED_WIDTH, width);
      const reply = await this.session.connection.request({
        type: "picture", camera: from, width: scaled, height: Math.round((scaled * height) / width), quality: "ray", format: "png",
      });
      if (!(reply instanceof Binary)) throw new Error("The simulator sent no picture.");
      const file = reply.u8("file");
      const type = String(reply.header["format"] ?? "png");
      const blob = new Blob([file.slice().buffer], { type: `image/${type}` });
      this.showTraced(URL.createObjectURL(blob), Number(reply.header["time_s"]));
    } catch (error) {
      this.session.emit("problem", error instanceof Error ? error.message : String(error));
      this.label("Ray trace");
    }
    this.trace.disabled = false;
  }

  private label(text: string): void {
    setText(this.traceText, text);
    this.trace.setAttribute("aria-label", text);
    this.trace.setAttribute("aria-pressed", String(text === "Show live"));
  }

  private showTraced(address: string | null, time = 0): void {
    if (this.address) URL.revokeObjectURL(this.address);
    this.address = address;
    this.traced.hidden = address === null;
    this.label(address ? "Show live" : "Ray trace");
    if (address) {
      this.traced.src = address;
      setText(this.caption, `Ray traced at ${time.toFixed(2)} s`);
      this.caption.hidden = false;
    } else {
      this.traced.removeAttribute("src");
      // The large view is straight, so that what is pointed at is where it is drawn.
      this.caption.hidden = !(this.world.through && this.camera?.distorts);
      setText(this.caption, "The large view lacks the lens's distortion");
      this.world.draw();
    }
  }
}

function name(camera: string): string {
  return camera.charAt(0).toUpperCase() + camera.slice(1);
}
