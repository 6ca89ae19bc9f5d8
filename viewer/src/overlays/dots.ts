/** Round marks at places: pins, held nodes, contacts. They are seen through tissue. */

import * as THREE from "three";
import { LAYER_OVERLAY } from "../scene/world.ts";

export class Dots {
  readonly points: THREE.Points<THREE.BufferGeometry, THREE.PointsMaterial>;
  private capacity = 0;

  constructor(size: number, opacity: number) {
    const material = new THREE.PointsMaterial({
      size, sizeAttenuation: true, vertexColors: true, map: disc(), alphaTest: 0.4,
      transparent: true, opacity, depthTest: false, depthWrite: false,
    });
    this.points = new THREE.Points(new THREE.BufferGeometry(), material);
    this.points.layers.set(LAYER_OVERLAY);
    this.points.frustumCulled = false;
    this.points.renderOrder = 5;
    this.points.visible = false;
  }

  /** Puts `count` marks at places with colours, both given by functions. */
  set(count: number, place: (i: number, into: Float32Array) => void, color: (i: number) => THREE.Color): void {
    const { geometry } = this.points;
    if (count > this.capacity) {
      this.capacity = Math.max(64, 2 ** Math.ceil(Math.log2(count)));
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * this.capacity), 3));
      geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * this.capacity), 3));
    }
    geometry.setDrawRange(0, count);
    if (count === 0) return;
    const positions = geometry.attributes["position"] as THREE.BufferAttribute;
    const colors = geometry.attributes["color"] as THREE.BufferAttribute;
    const at = new Float32Array(3);
    for (let i = 0; i < count; i += 1) {
      place(i, at);
      positions.setXYZ(i, at[0]!, at[1]!, at[2]!);
      const c = color(i);
      colors.setXYZ(i, c.r, c.g, c.b);
    }
    positions.needsUpdate = true;
    colors.needsUpdate = true;
  }
}

let shared: THREE.Texture | null = null;

function disc(): THREE.Texture {
  if (shared) return shared;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const context = canvas.getContext("2d");
  if (context) {
    context.fillStyle = "#fff";
    context.arc(16, 16, 14, 0, 2 * Math.PI);
    context.fill();
  }
  return (shared = new THREE.CanvasTexture(canvas));
}
