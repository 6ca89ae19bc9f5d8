/** A camera's lens distortion: OpenCV's rational model both ways, and a picture bent by it. */

import * as THREE from "three";
import type { CameraModel } from "../wire/messages.ts";

/** Cells of the grid that bends the picture, across and down. */
const ACROSS = 48;
const DOWN = 27;
/** The drawn picture has at most this times the pixels of the bent one, across and down. */
const MOST_STRETCH = 2;

/** The distorted image point of an ideal one, in units of the focal length; `k` is k1 k2 p1 p2 k3 k4 k5 k6. */
export function distorted(k: readonly number[], x: number, y: number): [number, number] {
  const [k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0] = k;
  const r2 = x * x + y * y;
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return [x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y];
}

/** The ideal image point of a distorted one, by Newton's method; null where the lens shows nothing. */
export function ideal(k: readonly number[], u: number, v: number): [number, number] | null {
  const step = 1e-6;
  let [x, y] = [u, v];
  for (let i = 0; i < 30; i += 1) {
    const [a, b] = distorted(k, x, y);
    const [ax, bx] = distorted(k, x + step, y);
    const [ay, by] = distorted(k, x, y + step);
    const [xx, yx, xy, yy] = [(ax - a) / step, (bx - b) / step, (ay - a) / step, (by - b) / step];
    const turn = xx * yy - xy * yx;
    // Beyond the fold of the polynomial places of the picture coincide.
    if (!(turn > 0)) return null;
    const [du, dv] = [u - a, v - b];
    if (Math.hypot(du, dv) < 1e-9) return [x, y];
    x += (yy * du - xy * dv) / turn;
    y += (xx * dv - yx * du) / turn;
  }
  return null;
}

/** What bends a picture: a wider camera without distortion, and a grid over its picture. */
export class Lens {
  private readonly camera = new THREE.PerspectiveCamera();
  private readonly target = new THREE.WebGLRenderTarget(2, 2, { type: THREE.HalfFloatType, samples: 4 });
  private readonly grid = new THREE.Scene();
  private readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  /** How much wider the drawn picture is than the bent one, across and down. */
  private readonly stretch: [number, number];

  /** Of a camera as three draws it. Throws nothing: what the lens does not show stays dark. */
  constructor(model: CameraModel, straight: THREE.PerspectiveCamera) {
    const { fx, fy, cx, cy, width, height, distortion = [] } = model;
    const corners: [x: number, y: number, at: [number, number] | null][] = [];
    for (let j = 0; j <= DOWN; j += 1) {
      for (let i = 0; i <= ACROSS; i += 1) {
        const [u, v] = [(i / ACROSS) * width, (j / DOWN) * height];
        corners.push([(2 * u) / width - 1, 1 - (2 * v) / height, ideal(distortion, (u - cx) / fx, (v - cy) / fy)]);
      }
    }
    const seen = corners.flatMap(([, , at]) => (at ? [at] : []));
    const bound = (k: 0 | 1, pick: (...all: number[]) => number): number => pick(...seen.map((at) => at[k]));
    const [left, right, top, bottom] = seen.length > 0
      ? [bound(0, Math.min), bound(0, Math.max), bound(1, Math.min), bound(1, Math.max)]
      : [-1, 1, -1, 1];
    this.stretch = [((right - left) * fx) / width, ((bottom - top) * fy) / height].map((s) => Math.min(Math.max(s, 1), MOST_STRETCH)) as [number, number];
    const { near, far } = straight;
    this.camera.projectionMatrix.makePerspective(left * near, right * near, -top * near, -bottom * near, near, far);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    this.camera.position.copy(straight.position);
    this.camera.quaternion.copy(straight.quaternion);
    this.camera.updateMatrixWorld();

    const places = corners.flatMap(([x, y]) => [x, y, 0]);
    const uvs = corners.flatMap(([, , at]) => (at ? [(at[0] - left) / (right - left), 1 - (at[1] - top) / (bottom - top)] : [-9, -9]));
    const cells: number[] = [];
    for (let j = 0; j < DOWN; j += 1) {
      for (let i = 0; i < ACROSS; i += 1) {
        const first = j * (ACROSS + 1) + i;
        const four = [first, first + 1, first + ACROSS + 1, first + ACROSS + 2];
        if (four.some((k) => !corners[k]![2])) continue;
        cells.push(four[0]!, four[2]!, four[1]!, four[1]!, four[2]!, four[3]!);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute(uvs, 2));
    geometry.setIndex(cells);
    const material = new THREE.ShaderMaterial({
      uniforms: { picture: { value: this.target.texture } },
      vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
      // Light in the drawn picture is linear: the screen's curve comes last.
      fragmentShader: "uniform sampler2D picture; varying vec2 at; void main() { gl_FragColor = vec4(texture2D(picture, at).rgb, 1.0);\n#include <tonemapping_fragment>\n#include <colorspace_fragment>\n}",
      depthTest: false,
    });
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this.grid.add(this.mesh);
  }

  /** Draws a scene into the renderer's present viewport of `width` x `height` pixels of the screen. */
  draw(renderer: THREE.WebGLRenderer, scene: THREE.Scene, width: number, height: number): void {
    const [w, h] = [Math.round(width * this.stretch[0]), Math.round(height * this.stretch[1])];
    if (this.target.width !== w || this.target.height !== h) this.target.setSize(w, h);
    renderer.setRenderTarget(this.target);
    renderer.render(scene, this.camera);
    renderer.setRenderTarget(null);
    renderer.render(this.grid, this.camera);
  }

  dispose(): void {
    this.target.dispose();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
