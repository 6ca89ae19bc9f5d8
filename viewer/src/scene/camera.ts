/** A camera of the scene: its lens as a projection, its frustum, its lamp. */

import * as THREE from "three";
import type { CameraModel } from "../wire/messages.ts";
import { Lens } from "./lens.ts";
import { setPose } from "./pose.ts";

const NEAR_M = 0.002;
const FAR_M = 3;
/** Half a turn about x: from OpenCV's axes (y down, z forward) to three's (y up, z back). */
const TO_THREE = new THREE.Quaternion(1, 0, 0, 0);

/** A camera of the scene as three draws it. */
export class SceneCamera {
  /** Without the lens's distortion. */
  readonly camera = new THREE.PerspectiveCamera();
  private bent: Lens | null = null;

  constructor(readonly model: CameraModel) {
    setPose(this.camera, model.pose, 0);
    this.camera.quaternion.multiply(TO_THREE);
    const { fx, fy, cx, cy, width, height } = model;
    const left = (-cx / fx) * NEAR_M;
    const right = ((width - cx) / fx) * NEAR_M;
    const top = (cy / fy) * NEAR_M;
    const bottom = (-(height - cy) / fy) * NEAR_M;
    this.camera.near = NEAR_M;
    this.camera.far = FAR_M;
    this.camera.fov = THREE.MathUtils.radToDeg(2 * Math.atan(height / 2 / fy));
    this.camera.aspect = width / height;
    this.camera.projectionMatrix.makePerspective(left, right, top, bottom, NEAR_M, FAR_M);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    this.camera.updateMatrixWorld();
  }

  /** Whether the lens distorts so much that the drawn picture differs from the camera's. */
  get distorts(): boolean {
    return (this.model.distortion ?? []).some((k) => Math.abs(k) > 1e-6);
  }

  /** What draws with the lens's distortion; null where there is none. */
  get lens(): Lens | null {
    if (this.distorts) this.bent ??= new Lens(this.model, this.camera);
    return this.bent;
  }

  dispose(): void {
    this.bent?.dispose();
    this.bent = null;
  }

  /** The frustum as lines, to a depth (m). */
  frustum(depth: number, material: THREE.LineBasicMaterial): THREE.LineSegments {
    const { fx, fy, cx, cy, width, height } = this.model;
    const corner = (u: number, v: number): number[] => [((u - cx) / fx) * depth, (-(v - cy) / fy) * depth, -depth];
    const corners = [corner(0, 0), corner(width, 0), corner(width, height), corner(0, height)];
    const points: number[] = [];
    corners.forEach((from, i) => {
      points.push(0, 0, 0, ...from, ...from, ...corners[(i + 1) % 4]!);
    });
    // A mark above the picture's upper edge.
    const [left, right] = [corner(width * 0.4, 0), corner(width * 0.6, 0)];
    const tip = corner(width * 0.5, -height * 0.12);
    points.push(...left, ...tip, ...tip, ...right);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    const lines = new THREE.LineSegments(geometry, material);
    lines.position.copy(this.camera.position);
    lines.quaternion.copy(this.camera.quaternion);
    return lines;
  }
}
