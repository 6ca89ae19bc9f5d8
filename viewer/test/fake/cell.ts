/** The fake cell: two organs that breathe, two tips that go where they are told, stages that pass. No physics. */

import { ball, plate, rod } from "./shapes.ts";

export const ORGANS = [
  { name: "appendix", color: [206, 120, 112], mesh: ball([0.005, 0.455, 0.04], [0.03, 0.012, 0.012], 18, 20), moves: true },
  { name: "cecum", color: [186, 92, 84], mesh: ball([-0.035, 0.475, 0.035], [0.028, 0.03, 0.02], 16, 20), moves: false },
];

export const MESHES = [
  { name: "table", color: [118, 124, 130], wet: false, metal: false, mesh: plate(0, 0.45, 0, 0.5, 0.4) },
  { name: "field", color: [160, 84, 76], wet: true, metal: false, mesh: plate(0, 0.46, 0.02, 0.16, 0.13) },
  { name: "shaft", color: [60, 64, 70], wet: false, metal: true, mesh: rod(-0.3, 0, 0.0025) },
  { name: "blade", color: [190, 194, 198], wet: false, metal: true, mesh: rod(0, 0.021, 0.0012) },
];

export const PORTS = [
  { name: "left", centre_m: [-0.045, 0.46, 0.16], normal: [0, 0, 1], hole_diameter_mm: 6 },
  { name: "right", centre_m: [0.045, 0.46, 0.16], normal: [0, 0, 1], hole_diameter_mm: 6 },
];

export const NUMBERS = ["first pivot", "second pivot", "insertion", "roll", "jaw"];
export const LOW = [-0.5, -0.5, 0.02, -2, 0];
export const HIGH = [0.5, 0.5, 0.16, 2, 1];
const START = [[-0.02, 0.455, 0.075], [0.03, 0.455, 0.075]];

export const COLUMNS = [
  ...["tip", "commanded"].flatMap((p) => [`${p}_x_m`, `${p}_y_m`, `${p}_z_m`, `${p}_qw`, `${p}_qx`, `${p}_qy`, `${p}_qz`]),
  "jaw", "jaw_rad",
  ...["measured", "commanded"].flatMap((p) => [0, 1, 2, 3, 4].map((k) => `${p}_${k}`)),
  ...["contact", "constraint"].flatMap((p) => ["x", "y", "z"].map((a) => `${p}_${a}_n`)),
  "jaw_force_n", "rcm_mm", "rcm_peak_mm", "attached", "held_back", "guarded", "load_limited", "pierces",
  "held_organ", "held_s", "follow", "slip_mm",
];
export const CHANNELS = ["time_s", "left_jaw_force_n", "left_rcm_mm", "right_rcm_mm", "lift_mm"];

export interface ArmState {
  tip: number[];
  target: number[];
  anchor: number[];
  clutch: number;
  jaw: number;
  jawTarget: number;
  actor: string;
  commandAt: number;
  seq: number;
  time_s: number;
}

export class Cell {
  step = 0;
  arms: ArmState[] = [];
  rows: number[][] = [];
  passedAt = [-1, -1];

  constructor() {
    this.reset();
  }

  reset(): void {
    this.step = 0;
    this.rows = [];
    this.passedAt = [-1, -1];
    this.arms = START.map((tip) => ({
      tip: [...tip], target: [...tip], anchor: [...tip], clutch: -1, jaw: 0.5, jawTarget: 0.5, actor: "policy", commandAt: 0, seq: 0, time_s: 0,
    }));
  }

  get time(): number {
    return this.step / 30;
  }

  /** One control period. */
  period(): void {
    this.step += 1;
    this.arms.forEach((arm, i) => {
      if (arm.actor === "policy") {
        const t = this.time;
        arm.target = [START[i]![0]! + 0.008 * Math.sin(t), START[i]![1]!, START[i]![2]! + 0.006 * Math.cos(1.3 * t)];
        arm.jawTarget = 0.5 + 0.4 * Math.sin(t);
      }
      for (let k = 0; k < 3; k += 1) arm.tip[k]! += Math.max(-0.0033, Math.min(0.0033, arm.target[k]! - arm.tip[k]!));
      arm.jaw += Math.max(-0.05, Math.min(0.05, arm.jawTarget - arm.jaw));
    });
    const near = Math.hypot(this.arms[0]!.tip[0]! + 0.02, this.arms[0]!.tip[2]! - 0.055) < 0.012;
    if (near && this.passedAt[0]! < 0) this.passedAt[0] = this.time;
    this.rows.push([this.time, 0.2 + 0.1 * Math.sin(this.time), this.rcm(0), this.rcm(1), this.lift()]);
  }

  /** Puts the state at an earlier step; the fake's motion depends on time alone. */
  seek(step: number): void {
    const arms = this.arms;
    this.reset();
    while (this.step < step) this.period();
    this.arms.forEach((arm, i) => (arm.actor = arms[i]!.actor));
  }

  lift(): number {
    return 5 + 5 * Math.sin(this.time);
  }

  rcm(arm: number): number {
    return 0.4 + 3 * arm * Math.abs(Math.sin(0.5 * this.time));
  }

  /** A tip's pose: the blades point from the port to the tip, past the centre by the deviation. */
  pose(arm: number): number[] {
    const tip = this.arms[arm]!.tip;
    const port = PORTS[arm]!.centre_m;
    const d = [tip[0]! - port[0]! - this.rcm(arm) / 1000, tip[1]! - port[1]!, tip[2]! - port[2]!];
    const length = Math.hypot(...d);
    const [x, y, z] = d.map((v) => v / length) as [number, number, number];
    // The shortest turn from x to the direction.
    const w = 1 + x;
    const q = [w, 0, -z, y];
    const n = Math.hypot(...q);
    return [...tip, ...q.map((v) => v / n)];
  }

  organ(index: number): Float32Array {
    const organ = ORGANS[index]!;
    const out = organ.mesh.vertices.slice();
    if (!organ.moves) return out;
    const rise = this.lift() / 1000;
    for (let i = 0; i < out.length; i += 3) {
      const s = Math.min(Math.max((out[i]! + 0.025) / 0.06, 0), 1);
      out[i + 2]! += rise * Math.sin(Math.PI * s);
    }
    return out;
  }

  /** The numbers of `COLUMNS` for both arms. */
  columns(): Float32Array {
    const out: number[] = [];
    this.arms.forEach((arm, i) => {
      const pose = this.pose(i);
      const five = [0.1 * i, -0.05, 0.1, 0, arm.jaw];
      const grasp = i === 0 ? [1, 0, 0, 0, 0, 0, 0.5, 0.95, 0.4] : [0, 0, 0, 0, 0, -1, 0, 0, 0];
      const [attached = 0, held_back = 0, guarded = 0, load = 0, pierces = 0, organ = 0, s = 0, follow = 0, slip = 0] = grasp;
      out.push(
        ...pose, ...arm.target, ...pose.slice(3), arm.jaw, arm.jaw * 1.05, ...five, ...five.slice(0, 4), arm.jawTarget,
        0.1, 0.2, 0.3 * i, 0, 0, i === 0 ? -0.4 : 0, 0.45, this.rcm(i), this.rcm(i) + 0.2,
        attached, held_back, guarded, load, pierces, organ, s, follow, slip,
      );
    });
    return Float32Array.from(out);
  }
}
