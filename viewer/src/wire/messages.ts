/** The wire of `trocar view`, version 1: the messages, as the reference documents them. */

export const VERSION = 1;

export type Side = string;
export type Seat = "controls" | Side;
/** x y z (m), then a unit quaternion w x y z. */
export type Pose = number[];
export type ValueKind = "stretch" | "energy";
export type Frame = "endoscope" | "tool" | "world";

/** Which client drives what; null is free. */
export type Seats = Record<string, number | null>;

export interface Hello {
  type: "hello";
  version: number;
  program: string;
  client: number;
  source: { kind: string; name: string };
  policies: string[];
  record: string | null;
  seats: Seats;
  speeds?: number[];
  command_life_ms?: number;
}

export interface Status {
  type: "status";
  phase: "building" | "ready" | "failed";
  message?: string | null;
  scene: number;
  seed: number;
  policy: string;
  playing: boolean;
  mode: "live" | "review" | "ended";
  speed_target: number;
  speed_actual: number;
  time_s: number;
  head_s: number;
  length_s: number;
  seekable_s: number;
  /** Whether a place to which was sought is still being computed. */
  seeking?: boolean;
  end?: { kind: string; text: string } | null;
  passed?: boolean;
  score?: number;
  actors: Record<string, string>;
  exact?: boolean | null;
  differs_s?: number | null;
  record?: { folder: string | null; state: string; path: string | null };
  seats: Seats;
  note?: string | null;
}

export interface Arm {
  name: string;
  kind: string;
  instrument: string;
  port: number | null;
  drive: string;
  numbers: string[];
  low: number[];
  high: number[];
  jaw_max_rad: number;
  blade_length_m: number;
  shaft_radius_m: number;
}

export interface Port {
  name: string;
  centre_m: number[];
  normal: number[];
  hole_diameter_mm: number;
}

export interface CameraModel {
  name: string;
  endoscope: boolean;
  pose: Pose;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  width: number;
  height: number;
  distortion?: number[];
  circle?: number | null;
}

export interface MeshHeader {
  name: string;
  color: number[];
  roughness: number;
  metal: boolean;
  wet: boolean;
  vertices: string;
  triangles: string;
  colors?: string | null;
}

export interface BodyHeader {
  name: string;
  mesh: number;
  arm: number | null;
  part: string;
  pose: Pose;
}

export interface Stage {
  name: string;
  when: string;
  weight?: number;
  channels?: string[];
}

export interface SceneHeader {
  type: "scene";
  scene: number;
  name: string;
  task: { name: string; summary: string; organ: string; prompt: string };
  control_hz: number;
  tissue_hz: number;
  seed: number;
  arms: Arm[];
  ports: Port[];
  rcm_mm: { threshold: number; abort: number };
  force_limit_n: number | null;
  cameras: CameraModel[];
  channels: string[];
  gates: { name: string; value: number }[];
  stages: Stage[];
  aborts?: { name: string; when: string }[];
  arm_columns: string[];
  meshes: MeshHeader[];
  bodies: BodyHeader[];
}

export interface OrgansHeader {
  type: "organs";
  scene: number;
  topology: number;
  organs: {
    name: string;
    count: number;
    triangles: string;
    colors: string;
    rest: string;
    young_modulus_pa?: number;
    pins?: string | null;
  }[];
}

export interface FrameHeader {
  type: "frame";
  frame: number;
  scene: number;
  topology: number;
  step: number;
  part: number;
  parts: number;
  time_s: number;
  mode: string;
  stage?: string | null;
  organs: { organ: number; low: number[]; step: number[]; positions: string; values?: string }[];
  value?: { kind: ValueKind; low: number; high: number; unit: string } | null;
  commands?: Record<string, { seq: number; time_s: number; waited_ms: number; step_ms: number } | null>;
  actors?: Record<string, string>;
  dropped?: number;
}

export interface EventMessage {
  type: "event";
  time_s: number;
  event: string;
  arm?: string;
  text: string;
}

export interface Episode {
  id: string;
  policy: string;
  seed: number;
  passed: boolean;
  end: string;
  score: number;
  stage?: string | null;
  duration_s: number;
  why?: string | null;
}

export interface Table {
  type: "table";
  kind: string;
  name: string;
  open: string | null;
  episodes: Episode[];
}

export interface Done {
  type: "done";
  request?: number;
  path?: string;
  passed?: boolean;
}

export interface WireError {
  type: "error";
  request?: number | null;
  code: string;
  message: string;
}

/** What a client asks to be sent. */
export interface Subscription {
  frames_hz: number;
  value: ValueKind | null;
  value_range?: [number, number];
  contacts: boolean;
  held: boolean;
  measured_hz: number;
  haptic: boolean;
}

/** A motion of an arm since its clutch was pressed. */
export interface ServoRelative {
  type: "servo_cr";
  arm: Side;
  seq: number;
  time_s: number;
  clutch: number;
  frame: Frame;
  camera?: string;
  scale: number;
  translation_m: [number, number, number];
  rotation_wxyz: [number, number, number, number];
  jaw?: number;
}
