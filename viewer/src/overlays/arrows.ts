/** Arrows of forces: their length is proportional to the force up to a longest one. */

import * as THREE from "three";
import { LAYER_OVERLAY } from "../scene/world.ts";

/** Length of an arrow for each newton (m). */
export const METRES_PER_NEWTON = 0.05;
const LONGEST_M = 0.06;
const SHORTEST_M = 0.0006;
const RADIUS_M = 0.0005;

export class Arrows {
  readonly group = new THREE.Group();
  private readonly shafts: THREE.InstancedMesh;
  private readonly heads: THREE.InstancedMesh;
  private readonly material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.95 });
  private count = 0;

  constructor(private readonly capacity: number) {
    const shaft = new THREE.CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(1, 1, 10).translate(0, 0.5, 0);
    this.shafts = new THREE.InstancedMesh(shaft, this.material, capacity);
    this.heads = new THREE.InstancedMesh(head, this.material, capacity);
    for (const mesh of [this.shafts, this.heads]) {
      mesh.layers.set(LAYER_OVERLAY);
      mesh.frustumCulled = false;
      mesh.renderOrder = 6;
      mesh.count = 0;
      this.group.add(mesh);
    }
    this.group.visible = false;
  }

  setColor(color: THREE.Color): void {
    this.material.color.copy(color);
  }

  begin(): void {
    this.count = 0;
  }

  /** An arrow from a place along a force (N). */
  add(place: THREE.Vector3, force: THREE.Vector3, thickness = 1): void {
    const newtons = force.length();
    const length = Math.min(newtons * METRES_PER_NEWTON, LONGEST_M);
    if (this.count >= this.capacity || !(length > SHORTEST_M)) return;
    const turn = TURN.setFromUnitVectors(UP, DIRECTION.copy(force).divideScalar(newtons));
    const radius = RADIUS_M * thickness;
    const head = Math.min(5 * radius, 0.6 * length);
    MATRIX.compose(place, turn, SCALE.set(radius, Math.max(length - head, 1e-5), radius));
    this.shafts.setMatrixAt(this.count, MATRIX);
    TIP.copy(DIRECTION).multiplyScalar(length - head).add(place);
    MATRIX.compose(TIP, turn, SCALE.set(2.4 * radius, head, 2.4 * radius));
    this.heads.setMatrixAt(this.count, MATRIX);
    this.count += 1;
  }

  end(): void {
    for (const mesh of [this.shafts, this.heads]) {
      mesh.count = this.count;
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  get shown(): number {
    return this.group.visible ? this.count : 0;
  }
}

const UP = new THREE.Vector3(0, 1, 0);
const DIRECTION = new THREE.Vector3();
const TURN = new THREE.Quaternion();
const MATRIX = new THREE.Matrix4();
const SCALE = new THREE.Vector3();
const TIP = new THREE.Vector3();
