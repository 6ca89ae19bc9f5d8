/** Poses as the wire has them. */

import type * as THREE from "three";

/** Sets an object's pose from seven numbers: x y z, then the quaternion w x y z. */
export function setPose(object: THREE.Object3D, pose: ArrayLike<number>, at: number): void {
  object.position.set(pose[at] ?? 0, pose[at + 1] ?? 0, pose[at + 2] ?? 0);
  object.quaternion.set(pose[at + 4] ?? 0, pose[at + 5] ?? 0, pose[at + 6] ?? 0, pose[at + 3] ?? 1).normalize();
}
