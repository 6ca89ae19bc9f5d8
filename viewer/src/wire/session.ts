/** What the page knows of the simulation: the newest of each message, and the organs' positions. */

import { Binary, dequantise } from "./binary.ts";
import { Connection } from "./connection.ts";
import { Emitter } from "./emitter.ts";
import type {
  Arm, Done, EventMessage, FrameHeader, Hello, OrgansHeader, SceneHeader, Seats, Status, Subscription, Table, WireError,
} from "./messages.ts";

/** A scene's header with the message that has its meshes. */
export interface SceneData {
  header: SceneHeader;
  data: Binary;
}

/** An organ's surface; `positions` and `values` change with each frame. */
export interface Organ {
  name: string;
  triangles: Uint32Array;
  colors: Uint8Array;
  pins: Float32Array;
  positions: Float32Array;
  values: Uint8Array | null;
  /** Grows whenever positions or values change. */
  version: number;
}

/** A frame: the header, and the arrays that it has. */
export interface FrameData {
  header: FrameHeader;
  poses: Float32Array;
  arms: Float32Array;
  row: Float32Array | null;
  stages: Float32Array;
  contacts: Float32Array;
  held: Float32Array;
}

interface Events {
  hello: Hello;
  status: Status;
  scene: SceneData;
  organs: Organ[];
  frame: FrameData;
  event: EventMessage;
  table: Table;
  seats: Seats;
  error: WireError;
  problem: string;
  done: Done;
}

/** What a status says before the scene is ready. */
const BEFORE: Status = {
  type: "status", phase: "building", scene: 0, seed: 0, policy: "", playing: false, mode: "live", speed_target: 1, speed_actual: 0,
  time_s: 0, head_s: 0, length_s: 0, seekable_s: 0, actors: {}, seats: {},
};

const NOTHING = new Float32Array(0);

export class Session extends Emitter<Events> {
  hello: Hello | null = null;
  status: Status | null = null;
  scene: SceneData | null = null;
  organs: Organ[] = [];
  frame: FrameData | null = null;
  table: Table | null = null;
  seats: Seats = {};
  /** When the newest frame came (ms, the page's clock). */
  frameAt = 0;
  /** Frames that came, and bytes of the newest. */
  framesReceived = 0;
  /** Milliseconds from a command to the frame that shows it, the newest. */
  latencyMs: number | null = null;
  private topology = -1;
  /** Number of the newest command of each arm that a frame showed. */
  private readonly shown = new Map<string, number>();
  private readonly columns = new Map<string, number>();
  private readonly channels = new Map<string, number>();
  private subscription: Subscription = {
    frames_hz: 60, value: null, contacts: false, held: false, measured_hz: 0, haptic: false,
  };

  constructor(readonly connection: Connection) {
    super();
    connection.on("text", (message) => this.text(message));
    connection.on("binary", (message) => this.binary(message));
    connection.on("problem", (problem) => this.emit("problem", problem));
    connection.on("link", (link) => {
      if (link !== "open") return;
      this.frame = null;
    });
  }

  /** Whether this page has a seat. */
  has(seat: string): boolean {
    return this.hello !== null && this.seats[seat] === this.hello.client;
  }

  /** Whether another client has a seat. */
  taken(seat: string): boolean {
    const client = this.seats[seat];
    return client !== null && client !== undefined && client !== this.hello?.client;
  }

  /** Whether clients only watch: the simulation is an environment that another program steps. */
  get watches(): boolean {
    return this.hello?.source.kind === "environment";
  }

  get arms(): Arm[] {
    return this.scene?.header.arms ?? [];
  }

  /** A number of an arm in the newest frame; NaN without one. */
  arm(arm: number, column: string): number {
    const place = this.columns.get(column);
    const width = this.scene?.header.arm_columns.length ?? 0;
    if (place === undefined || !this.frame) return Number.NaN;
    return this.frame.arms[arm * width + place] ?? Number.NaN;
  }

  /** Several numbers of an arm that stand side by side, from `column` on. */
  armVector(arm: number, column: string, count: number): number[] {
    const place = this.columns.get(column);
    const width = this.scene?.header.arm_columns.length ?? 0;
    if (place === undefined || !this.frame) return new Array<number>(count).fill(Number.NaN);
    return Array.from(this.frame.arms.subarray(arm * width + place, arm * width + place + count));
  }

  /** A channel's number in the newest row; NaN without one. */
  channel(name: string): number {
    const place = this.channels.get(name);
    return place === undefined ? Number.NaN : (this.frame?.row?.[place] ?? Number.NaN);
  }

  /** Changes what the server sends. */
  subscribe(change: Partial<Subscription>): void {
    this.subscription = { ...this.subscription, ...change };
    this.connection.send({ type: "subscribe", ...this.subscription } as { type: string });
  }

  /** Asks for something and says on the page what is wrong with it. */
  async ask(message: { type: string; [key: string]: unknown }): Promise<boolean> {
    try {
      await this.connection.request(message);
      return true;
    } catch (error) {
      this.emit("problem", error instanceof Error ? error.message : String(error));
      return false;
    }
  }

  private text(message: Record<string, unknown> & { type: string }): void {
    switch (message.type) {
      case "hello":
        this.hello = message as unknown as Hello;
        this.setSeats(this.hello.seats);
        this.emit("hello", this.hello);
        this.subscribe({});
        break;
      case "status":
        this.status = { ...BEFORE, ...(message as Partial<Status>) };
        if (message["seats"]) this.setSeats(this.status.seats);
        this.emit("status", this.status);
        break;
      case "seats": {
        const { type: _type, ...seats } = message;
        this.setSeats(seats as Seats);
        break;
      }
      case "event":
        this.emit("event", message as unknown as EventMessage);
        break;
      case "table":
        this.table = message as unknown as Table;
        this.emit("table", this.table);
        break;
      case "error":
        this.emit("error", message as unknown as WireError);
        break;
      case "done":
        this.emit("done", message as unknown as Done);
        break;
    }
  }

  private setSeats(seats: Seats): void {
    if (JSON.stringify(seats) === JSON.stringify(this.seats)) return;
    this.seats = seats;
    this.emit("seats", seats);
  }

  private binary(message: Binary): void {
    switch (message.header.type) {
      case "scene": {
        const header = message.header as unknown as SceneHeader;
        this.scene = { header, data: message };
        this.columns.clear();
        header.arm_columns.forEach((name, place) => this.columns.set(name, place));
        this.channels.clear();
        header.channels.forEach((name, place) => this.channels.set(name, place));
        this.organs = [];
        this.frame = null;
        this.emit("scene", this.scene);
        break;
      }
      case "organs":
        this.setOrgans(message);
        break;
      case "frame":
        this.setFrame(message);
        break;
    }
  }

  private setOrgans(message: Binary): void {
    const header = message.header as unknown as OrgansHeader;
    this.topology = header.topology;
    this.organs = header.organs.map((organ) => ({
      name: organ.name,
      triangles: message.u32(organ.triangles),
      colors: message.u8(organ.colors),
      pins: organ.pins ? message.f32(organ.pins) : NOTHING,
      positions: message.f32(organ.rest).slice(),
      values: null,
      version: 0,
    }));
    this.emit("organs", this.organs);
  }

  private setFrame(message: Binary): void {
    const header = message.header as unknown as FrameHeader;
    if (!this.scene || header.scene !== this.scene.header.scene || header.topology !== this.topology) return;
    for (const moved of header.organs) {
      const organ = this.organs[moved.organ];
      if (!organ) continue;
      dequantise(moved.low, moved.step, message.u16(moved.positions), organ.positions);
      organ.values = moved.values ? message.u8(moved.values) : null;
      organ.version += 1;
    }
    const array = (name: string): Float32Array => (message.has(name) ? message.f32(name) : NOTHING);
    this.frame = {
      header,
      poses: array("poses"),
      arms: array("arms"),
      row: message.has("row") ? message.f32("row") : null,
      stages: array("stages"),
      contacts: array("contacts"),
      held: array("held"),
    };
    this.framesReceived += 1;
    this.frameAt = performance.now();
    for (const [arm, command] of Object.entries(header.commands ?? {})) {
      if (!command || command.seq === this.shown.get(arm)) continue;
      this.shown.set(arm, command.seq);
      this.latencyMs = this.frameAt - command.time_s * 1000;
    }
    this.emit("frame", this.frame);
  }
}
