/** The organs' surfaces: wet tissue with its recorded colours, or coloured by a value of each vertex. */

import * as THREE from "three";
import type { Organ, Session } from "../wire/session.ts";
import { linear } from "./bodies.ts";
import { ramp } from "./ramp.ts";
import type { World } from "./world.ts";

interface Surface {
  organ: Organ;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  colors: Float32Array;
  drawn: number;
  valued: boolean;
}

export class Organs {
  private surfaces: Surface[] = [];
  private readonly group = new THREE.Group();

  constructor(private readonly world: World, session: Session) {
    world.scene.add(this.group);
    session.on("organs", (organs) => this.build(organs));
    session.on("scene", () => this.clear());
    session.on("frame", () => world.draw());
    world.update.push(() => this.move());
  }

  get names(): string[] {
    return this.surfaces.map((surface) => surface.organ.name);
  }

  /** Bounds of an organ, or of all. */
  bounds(name?: string): THREE.Box3 {
    const box = new THREE.Box3();
    for (const { organ } of this.surfaces) {
      if (name !== undefined && organ.name !== name) continue;
      box.union(new THREE.Box3().setFromArray(organ.positions));
    }
    return box;
  }

  /** Makes the organs transparent, so that what lies inside is seen. */
  setTransparent(on: boolean): void {
    for (const { mesh } of this.surfaces) transparent(mesh.material, on);
    this.see = on;
    this.world.draw();
  }
  private see = false;

  private build(organs: Organ[]): void {
    this.clear();
    this.surfaces = organs.map((organ) => {
      const geometry = new THREE.BufferGeometry();
      const positions = new THREE.BufferAttribute(organ.positions, 3).setUsage(THREE.DynamicDrawUsage);
      geometry.setAttribute("position", positions);
      const own = linear(organ.colors);
      const colors = new THREE.BufferAttribute(own.slice(), 3).setUsage(THREE.DynamicDrawUsage);
      geometry.setAttribute("color", colors);
      geometry.setIndex(new THREE.BufferAttribute(organ.triangles, 1));
      geometry.computeVertexNormals();
      const material = new THREE.MeshPhysicalMaterial({
        vertexColors: true,
        roughness: 0.52,
        clearcoat: 0.75,
        clearcoatRoughness: 0.2,
        sheen: 0.25,
        sheenRoughness: 0.6,
        sheenColor: new THREE.Color(0.5, 0.2, 0.18),
      });
      transparent(material, this.see);
      const mesh = new THREE.Mesh(geometry, material);
      mesh.frustumCulled = false;
      mesh.name = organ.name;
      this.group.add(mesh);
      return { organ, mesh, colors: own, drawn: 0, valued: false };
    });
    this.world.draw();
  }

  private move(): void {
    for (const surface of this.surfaces) {
      const { organ, mesh } = surface;
      if (organ.version === surface.drawn) continue;
      surface.drawn = organ.version;
      const { geometry } = mesh;
      geometry.attributes["position"]!.needsUpdate = true;
      normals(geometry);
      this.paint(surface);
    }
  }

  private paint(surface: Surface): void {
    const { organ, mesh } = surface;
    if (!organ.values && !surface.valued) return;
    const colors = mesh.geometry.attributes["color"] as THREE.BufferAttribute;
    if (organ.values) ramp(organ.values, colors.array as Float32Array);
    else (colors.array as Float32Array).set(surface.colors);
    surface.valued = organ.values !== null;
    colors.needsUpdate = true;
    mesh.material.clearcoat = surface.valued ? 0.15 : 0.75;
  }

  private clear(): void {
    for (const { mesh } of this.surfaces) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.group.clear();
    this.surfaces = [];
  }
}

function transparent(material: THREE.MeshPhysicalMaterial, on: boolean): void {
  material.transparent = on;
  material.opacity = on ? 0.42 : 1;
  material.depthWrite = !on;
  material.needsUpdate = true;
}

/** Normals of vertices, weighted by area; quicker than three's, which goes through accessors. */
function normals(geometry: THREE.BufferGeometry): void {
  const p = geometry.attributes["position"]!.array as Float32Array;
  const attribute = geometry.attributes["normal"] as THREE.BufferAttribute;
  const n = attribute.array as Float32Array;
  const t = geometry.index!.array;
  n.fill(0);
  for (let i = 0; i + 2 < t.length; i += 3) {
    const a = 3 * t[i]!;
    const b = 3 * t[i + 1]!;
    const c = 3 * t[i + 2]!;
    const ux = p[b]! - p[a]!;
    const uy = p[b + 1]! - p[a + 1]!;
    const uz = p[b + 2]! - p[a + 2]!;
    const vx = p[c]! - p[a]!;
    const vy = p[c + 1]! - p[a + 1]!;
    const vz = p[c + 2]! - p[a + 2]!;
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    for (const at of [a, b, c]) {
      n[at]! += x;
      n[at + 1]! += y;
      n[at + 2]! += z;
    }
  }
  for (let i = 0; i + 2 < n.length; i += 3) {
    const length = Math.hypot(n[i]!, n[i + 1]!, n[i + 2]!) || 1;
    n[i]! /= length;
    n[i + 1]! /= length;
    n[i + 2]! /= length;
  }
  attribute.needsUpdate = true;
}
