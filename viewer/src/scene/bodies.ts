/** What is rigid: table, ports, arms, instruments. Each is a mesh at a pose. */

import * as THREE from "three";
import type { Session } from "../wire/session.ts";
import { setPose } from "./pose.ts";
import { LAYER_OUTSIDE, type World } from "./world.ts";

/** Meshes that the endoscope does not see, because they hold it. */
const BEHIND_ENDOSCOPE = new Set(["endoscope", "holders", "stand"]);
/** Meshes that are drawn from both sides. */
const SHEETS = new Set(["wall", "field", "tray"]);

export class Bodies {
  private readonly group = new THREE.Group();
  private moving: THREE.Object3D[] = [];
  private materials: THREE.Material[] = [];
  private geometries: THREE.BufferGeometry[] = [];
  /** Bodies by the name of their mesh or their own, for the switches. */
  private named = new Map<string, THREE.Object3D[]>();

  constructor(private readonly world: World, private readonly session: Session) {
    world.scene.add(this.group);
    session.on("scene", () => this.build());
    world.update.push(() => this.move());
  }

  /** Shows or hides the bodies of a part: `link`, `shaft`, `wall`, ... */
  show(part: string, on: boolean): void {
    for (const object of this.named.get(part) ?? []) object.visible = on;
    this.world.draw();
  }

  private build(): void {
    this.clear();
    const scene = this.session.scene;
    if (!scene) return;
    const { header, data } = scene;
    header.meshes.forEach((mesh) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(data.f32(mesh.vertices), 3));
      geometry.setIndex(new THREE.BufferAttribute(data.u32(mesh.triangles), 1));
      const colored = Boolean(mesh.colors && data.has(mesh.colors));
      if (colored && mesh.colors) {
        geometry.setAttribute("color", new THREE.BufferAttribute(linear(data.u8(mesh.colors)), 3));
      }
      geometry.computeVertexNormals();
      const [r = 200, g = 200, b = 200] = mesh.color;
      const color = colored ? new THREE.Color(1, 1, 1) : new THREE.Color().setRGB(r / 255, g / 255, b / 255, THREE.SRGBColorSpace);
      this.geometries.push(geometry);
      this.materials.push(
        new THREE.MeshPhysicalMaterial({
          color,
          vertexColors: colored,
          roughness: mesh.wet ? 0.5 : Math.min(Math.max(mesh.roughness, 0.3), 1),
          metalness: mesh.metal ? 0.65 : 0,
          clearcoat: mesh.wet ? 0.6 : 0,
          clearcoatRoughness: 0.22,
          side: SHEETS.has(mesh.name) ? THREE.DoubleSide : THREE.FrontSide,
        }),
      );
    });
    for (const body of header.bodies) {
      const geometry = this.geometries[body.mesh];
      const material = this.materials[body.mesh];
      if (!geometry || !material) continue;
      const mesh = new THREE.Mesh(geometry, material);
      setPose(mesh, body.pose, 0);
      const name = header.meshes[body.mesh]?.name ?? "";
      if (BEHIND_ENDOSCOPE.has(name)) mesh.layers.set(LAYER_OUTSIDE);
      for (const key of new Set([name, body.part])) this.named.set(key, [...(this.named.get(key) ?? []), mesh]);
      this.group.add(mesh);
      if (body.part !== "fixed") this.moving.push(mesh);
    }
    this.world.draw();
  }

  private move(): void {
    const poses = this.session.frame?.poses;
    if (!poses) return;
    this.moving.forEach((mesh, row) => {
      if (7 * row + 6 < poses.length) setPose(mesh, poses, 7 * row);
    });
  }

  private clear(): void {
    this.group.clear();
    for (const thing of [...this.geometries, ...this.materials]) thing.dispose();
    this.geometries = [];
    this.materials = [];
    this.moving = [];
    this.named.clear();
  }
}

/** Linear colours (0 to 1) from sRGB bytes. */
export function linear(bytes: Uint8Array): Float32Array {
  const out = new Float32Array(bytes.length);
  for (let i = 0; i < bytes.length; i += 1) out[i] = SRGB[bytes[i]!]!;
  return out;
}

const SRGB = Float32Array.from({ length: 256 }, (_, i) => {
  const c = i / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
});
