/** At each port: the hole, rings at the task's limits, and where the shaft's axis crosses the port. */

import * as THREE from "three";
import { LAYER_OVERLAY, type World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";
import { tint, type Tint } from "./palette.ts";

const SEGMENTS = 64;

interface Mark {
  arm: number;
  centre: THREE.Vector3;
  normal: THREE.Vector3;
  cross: THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>;
  line: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
}

export class Rcm {
  readonly group = new THREE.Group();
  private marks: Mark[] = [];
  private rings: [THREE.LineBasicMaterial, Tint][] = [];

  constructor(private readonly world: World, private readonly session: Session) {
    world.scene.add(this.group);
    this.group.visible = false;
    session.on("scene", () => this.build());
    world.update.push(() => this.update());
  }

  show(on: boolean): void {
    this.group.visible = on;
    this.world.draw();
  }

  /** Where the shaft's axis crosses each port, as distance from its centre (mm); for tests. */
  get crossings(): number[] {
    return this.marks.map((mark) => mark.cross.position.distanceTo(mark.centre) * 1000);
  }

  private build(): void {
    this.group.clear();
    this.marks = [];
    this.rings = [];
    const header = this.session.scene?.header;
    if (!header) return;
    header.arms.forEach((arm, index) => {
      const port = arm.port === null ? undefined : header.ports[arm.port];
      if (!port) return;
      const centre = new THREE.Vector3().fromArray(port.centre_m);
      const normal = new THREE.Vector3().fromArray(port.normal).normalize();
      this.ring(centre, normal, port.hole_diameter_mm / 2000, "soft");
      this.ring(centre, normal, header.rcm_mm.threshold / 1000, "warn");
      this.ring(centre, normal, header.rcm_mm.abort / 1000, "bad");
      const cross = new THREE.Mesh(
        new THREE.SphereGeometry(0.0005, 12, 8),
        new THREE.MeshBasicMaterial({ depthTest: false, transparent: true }),
      );
      const line = new THREE.Line(
        new THREE.BufferGeometry().setFromPoints([centre, centre]),
        new THREE.LineBasicMaterial({ depthTest: false, transparent: true }),
      );
      for (const object of [cross, line]) this.put(object);
      this.marks.push({ arm: index, centre, normal, cross, line });
    });
  }

  private ring(centre: THREE.Vector3, normal: THREE.Vector3, radius: number, color: Tint): void {
    const points = Array.from({ length: SEGMENTS }, (_, i) => {
      const angle = (2 * Math.PI * i) / SEGMENTS;
      return new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), 0);
    });
    const material = new THREE.LineBasicMaterial({ depthTest: false, transparent: true });
    const ring = new THREE.LineLoop(new THREE.BufferGeometry().setFromPoints(points), material);
    ring.position.copy(centre);
    ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    this.rings.push([material, color]);
    this.put(ring);
  }

  private put(object: THREE.Object3D): void {
    object.layers.set(LAYER_OVERLAY);
    object.renderOrder = 7;
    object.frustumCulled = false;
    this.group.add(object);
  }

  private update(): void {
    if (!this.group.visible) return;
    for (const [material, color] of this.rings) tint(color, material.color);
    const limits = this.session.scene?.header.rcm_mm;
    for (const { arm, centre, normal, cross, line } of this.marks) {
      const [x = 0, y = 0, z = 0, w = 1, i = 0, j = 0, k = 0] = this.session.armVector(arm, "tip_x_m", 7);
      const tip = new THREE.Vector3(x, y, z);
      const axis = new THREE.Vector3(1, 0, 0).applyQuaternion(new THREE.Quaternion(i, j, k, w));
      const along = axis.dot(normal);
      if (!(Math.abs(along) > 1e-3)) continue;
      const t = centre.clone().sub(tip).dot(normal) / along;
      cross.position.copy(tip).addScaledVector(axis, t);
      const mm = this.session.arm(arm, "rcm_mm");
      const color: Tint = !limits || mm < limits.threshold ? "good" : mm < limits.abort ? "warn" : "bad";
      tint(color, cross.material.color);
      tint(color, line.material.color);
      line.geometry.setFromPoints([centre, cross.position]);
    }
  }
}
