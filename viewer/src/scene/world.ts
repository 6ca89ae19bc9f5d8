/** The drawn world: renderer, lights, the camera that the user moves, and when to draw. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { SceneCamera } from "./camera.ts";
import { studio } from "./studio.ts";

/** Layer of what only the user's camera sees: frustums, the endoscope's own shaft. */
export const LAYER_OUTSIDE = 1;
/** Layer of the overlays: the large view has them, the small one shows the plain picture. */
export const LAYER_OVERLAY = 2;

const FLY_MS = 450;
const INSIDE = new THREE.Color(0x05080a);

export class World {
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(42, 1, 0.005, 6);
  readonly controls: OrbitControls;
  readonly renderer: THREE.WebGLRenderer;
  /** What draws in each picture before the main view: the endoscope's canvas. */
  readonly before: (() => void)[] = [];
  /** What brings the scene up to date before a picture is drawn. */
  readonly update: (() => void)[] = [];
  private dirty = true;
  private flight: { from: THREE.Vector3[]; to: THREE.Vector3[]; begin: number } | null = null;
  private home: { target: THREE.Vector3; eye: THREE.Vector3 } | null = null;
  private readonly background = new THREE.DataTexture(new Uint8Array(4 * 64), 1, 64);
  /** Pictures drawn, for tests and for the rate on the page. */
  pictures = 0;
  /** The camera of the scene that the main view looks through; null: the user's own. */
  through: SceneCamera | null = null;
  private readonly lamps: [light: THREE.Light, outside: number, inside: number][] = [];

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.0;
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0.0, -0.1, 0.6);
    this.camera.layers.enable(LAYER_OUTSIDE);
    this.camera.layers.enable(LAYER_OVERLAY);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.screenSpacePanning = true;
    this.controls.minDistance = 0.02;
    this.controls.maxDistance = 4;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => (this.flight = null));
    this.light();
    this.theme();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.theme();
      this.draw();
    });
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement ?? canvas);
    this.resize();
    const loop = (): void => {
      requestAnimationFrame(loop);
      this.tick();
    };
    loop();
  }

  /** Asks for a picture at the next opportunity. */
  draw(): void {
    this.dirty = true;
  }

  /** Draws now, for a saved picture: the drawing lives until the browser shows it. */
  drawNow(): void {
    for (const update of this.update) update();
    for (const draw of this.before) draw();
    const { x: width, y: height } = this.size;
    this.through?.camera.layers.enable(LAYER_OVERLAY);
    // In the large view things are pointed at: it is straight.
    this.drawFrom(this.through, 0, 0, width, height, true);
    this.through?.camera.layers.disable(LAYER_OVERLAY);
    this.pictures += 1;
  }

  /** Draws what a camera sees into a rectangle of the canvas (CSS pixels, from below left); `straight`: without its lens's distortion. */
  drawFrom(from: SceneCamera | null, x: number, y: number, width: number, height: number, straight = false): void {
    const { renderer } = this;
    renderer.setScissorTest(true);
    renderer.setScissor(x, y, width, height);
    renderer.setViewport(x, y, width, height);
    for (const [light, outside, inside] of this.lamps) light.intensity = from ? inside : outside;
    this.scene.environmentIntensity = from?.model.endoscope ? 0.22 : 0.55;
    if (!from) {
      this.scene.background = this.background;
      const aspect = this.camera.aspect;
      if (Math.abs(width / height - aspect) > 1e-3) {
        this.camera.aspect = width / height;
        this.camera.updateProjectionMatrix();
        renderer.render(this.scene, this.camera);
        this.camera.aspect = aspect;
        this.camera.updateProjectionMatrix();
      } else renderer.render(this.scene, this.camera);
      return;
    }
    this.scene.background = INSIDE;
    const aspect = from.model.width / from.model.height;
    const w = Math.min(width, height * aspect);
    const h = Math.min(height, width / aspect);
    const lens = straight ? null : from.lens;
    if (lens || w < width || h < height) {
      renderer.setClearColor(INSIDE);
      renderer.clear();
      renderer.setViewport(x + (width - w) / 2, y + (height - h) / 2, w, h);
    }
    const ratio = renderer.getPixelRatio();
    if (lens) lens.draw(renderer, this.scene, w * ratio, h * ratio);
    else renderer.render(this.scene, from.camera);
  }

  /** The camera that the main view looks through. */
  get mainCamera(): THREE.Camera {
    return this.through?.camera ?? this.camera;
  }

  /** Where the main view's picture lies in the canvas (CSS pixels, from above left). */
  get mainRect(): { x: number; y: number; width: number; height: number } {
    const { x: width, y: height } = this.size;
    if (!this.through) return { x: 0, y: 0, width, height };
    const aspect = this.through.model.width / this.through.model.height;
    const w = Math.min(width, height * aspect);
    const h = Math.min(height, width / aspect);
    return { x: (width - w) / 2, y: (height - h) / 2, width: w, height: h };
  }

  /** Adds a lamp with its light in the user's view and in the views of the scene's cameras. */
  addLamp(light: THREE.Light, outside: number, inside: number): void {
    this.lamps.push([light, outside, inside]);
    this.scene.add(light);
  }

  /** Size of the canvas (CSS pixels). */
  get size(): THREE.Vector2 {
    return this.renderer.getSize(new THREE.Vector2());
  }

  /** Moves the camera to see a box; keeps the direction unless `from` gives one. */
  flyTo(box: THREE.Box3, from?: THREE.Vector3): void {
    if (box.isEmpty()) return;
    const { target, eye } = this.placeFor(box, from ?? this.camera.position.clone().sub(this.controls.target));
    this.fly(target, eye);
  }

  /** Sets the view that `showHome` returns to; the first one is shown at once. */
  setHome(box: THREE.Box3, from: THREE.Vector3): void {
    if (box.isEmpty()) return;
    const first = this.home === null;
    this.home = this.placeFor(box, from);
    if (!first) return;
    this.fly(this.home.target, this.home.eye);
    this.land();
  }

  private placeFor(box: THREE.Box3, from: THREE.Vector3): { target: THREE.Vector3; eye: THREE.Vector3 } {
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    const half = THREE.MathUtils.degToRad(this.camera.fov / 2);
    const fit = Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect));
    const distance = Math.max((sphere.radius * 1.05) / Math.sin(fit), 0.03);
    return { target: sphere.center, eye: sphere.center.clone().addScaledVector(from.clone().normalize(), distance) };
  }

  showHome(): void {
    if (this.home) this.fly(this.home.target, this.home.eye);
  }

  /** Turns the camera round its target by angles (rad): keys use it. */
  orbit(azimuth: number, polar: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const length = offset.length();
    const angle = Math.atan2(offset.y, offset.x) + azimuth;
    const height = THREE.MathUtils.clamp(Math.asin(offset.z / length) + polar, -1.5, 1.5);
    offset.set(Math.cos(angle) * Math.cos(height), Math.sin(angle) * Math.cos(height), Math.sin(height));
    this.camera.position.copy(this.controls.target).addScaledVector(offset, length);
    this.camera.lookAt(this.controls.target);
    this.controls.update();
    this.draw();
  }

  /** Moves the camera nearer (below 1) or farther. */
  zoom(factor: number): void {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  private fly(target: THREE.Vector3, eye: THREE.Vector3): void {
    this.flight = {
      from: [this.controls.target.clone(), this.camera.position.clone()],
      to: [target.clone(), eye.clone()],
      begin: performance.now(),
    };
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.land();
    this.draw();
  }

  private land(): void {
    if (!this.flight) return;
    this.controls.target.copy(this.flight.to[0]!);
    this.camera.position.copy(this.flight.to[1]!);
    this.flight = null;
    this.controls.update();
    this.draw();
  }

  private tick(): void {
    if (this.flight) {
      const t = (performance.now() - this.flight.begin) / FLY_MS;
      if (t >= 1) this.land();
      else {
        const smooth = t * t * (3 - 2 * t);
        this.controls.target.lerpVectors(this.flight.from[0]!, this.flight.to[0]!, smooth);
        this.camera.position.lerpVectors(this.flight.from[1]!, this.flight.to[1]!, smooth);
        this.controls.update();
      }
      this.dirty = true;
    }
    if (!this.dirty) return;
    this.dirty = false;
    this.drawNow();
  }

  private resize(): void {
    const parent = this.canvas.parentElement ?? this.canvas;
    const width = Math.max(parent.clientWidth, 2);
    const height = Math.max(parent.clientHeight, 2);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private light(): void {
    this.scene.environment = studio(this.renderer);
    const key = new THREE.DirectionalLight(0xfff4e8);
    key.position.set(0.4, -0.5, 1.2);
    const fill = new THREE.DirectionalLight(0xdfeaff);
    fill.position.set(-0.9, 0.6, 0.7);
    this.addLamp(key, 1.5, 0.35);
    this.addLamp(fill, 0.5, 0.1);
  }

  private theme(): void {
    const style = getComputedStyle(document.documentElement);
    const top = new THREE.Color(style.getPropertyValue("--ground-top").trim());
    const bottom = new THREE.Color(style.getPropertyValue("--ground-bottom").trim());
    const pixels = this.background.image.data as Uint8Array;
    const mixed = new THREE.Color();
    for (let row = 0; row < 64; row += 1) {
      mixed.lerpColors(bottom, top, row / 63).convertLinearToSRGB();
      pixels.set([mixed.r, mixed.g, mixed.b, 1].map((c) => Math.round(c * 255)), row * 4);
    }
    this.background.colorSpace = THREE.SRGBColorSpace;
    this.background.magFilter = THREE.LinearFilter;
    this.background.needsUpdate = true;
  }
}
