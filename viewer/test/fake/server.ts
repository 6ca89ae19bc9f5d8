/** A server that speaks the wire over the fake cell, for what the page's tests must try without a simulator. */

import { createServer, type Server } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { WebSocketServer, type WebSocket } from "ws";
import { Cell, CHANNELS, COLUMNS, HIGH, LOW, MESHES, NUMBERS, ORGANS, PORTS } from "./cell.ts";
import { pack, type Packed } from "./pack.ts";

const TYPES: Record<string, string> = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
/** What the page must work with: nothing inline, nothing from elsewhere. */
const POLICY = "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' ws:; media-src blob:; object-src 'none'";
export const TOKEN = "test-token";
const LENGTH_S = 40;
const COMMAND_LIFE_MS = 125;
const PICTURE = Buffer.from(
  "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAFElEQVR4nGM8ceIEAwMDEwMDAwMDABGgAbS6bW8sAAAAAElFTkSuQmCC", "base64",
);

interface Client {
  socket: WebSocket;
  number: number;
  value: string | null;
  contacts: boolean;
  held: boolean;
  sent: Set<number>;
}

type Message = Record<string, unknown> & { type: string };

export class FakeServer {
  readonly cell = new Cell();
  /** All that clients sent, for the tests to look at. */
  readonly received: Message[] = [];
  seats: Record<string, number | null> = { controls: null, left: null, right: null };
  playing = true;
  mode = "live";
  speed = 1;
  policy = "scripted";
  seed = 0;
  record: string | null = "/tmp/demonstrations";
  /** What is shown; an environment is watched, and nothing of it can be driven. */
  kind = "scene";
  kept = 0;
  open: string | null = null;
  /** Sends no frames: a simulator that hangs. */
  silent = false;
  private readonly clients = new Set<Client>();
  private readonly http: Server;
  private readonly sockets: WebSocketServer;
  private readonly timer: NodeJS.Timeout;
  private numbers = 0;
  private frames = 0;
  private scene = 1;
  private topology = 1;
  private ticks = 0;

  constructor(private readonly dist: string) {
    this.http = createServer((request, response) => void this.page(request.url ?? "/").then(([status, type, body]) => {
      response.writeHead(status, { "content-type": type, "content-security-policy": POLICY });
      response.end(body);
    }));
    this.sockets = new WebSocketServer({ noServer: true });
    this.http.on("upgrade", (request, socket, head) => {
      const url = new URL(request.url ?? "/", "http://localhost");
      if (url.searchParams.get("token") !== TOKEN) return void socket.end("HTTP/1.1 401 Unauthorized\r\n\r\n");
      this.sockets.handleUpgrade(request, socket, head, (web) => this.join(web));
    });
    this.timer = setInterval(() => this.tick(), 1000 / 30);
  }

  async listen(): Promise<string> {
    await new Promise<void>((done) => this.http.listen(0, "127.0.0.1", done));
    const address = this.http.address();
    return `http://127.0.0.1:${typeof address === "object" && address ? address.port : 0}/?token=${TOKEN}`;
  }

  close(): void {
    clearInterval(this.timer);
    for (const client of this.clients) client.socket.terminate();
    this.sockets.close();
    this.http.closeAllConnections();
    this.http.close();
  }

  /** Cuts every connection, as a network does. */
  drop(): void {
    for (const client of this.clients) client.socket.terminate();
  }

  /** Gives a seat to somebody else. */
  takeAway(seat: string): void {
    this.seats[seat] = 999;
    this.tell({ type: "seats", ...this.seats });
  }

  /** Messages of a type, the oldest first. */
  of(type: string): Message[] {
    return this.received.filter((message) => message.type === type);
  }

  /** A cut: the organs are sent again with another topology. */
  cut(): void {
    this.topology += 1;
    for (const client of this.clients) this.sendOrgans(client);
  }

  private async page(url: string): Promise<[number, string, Buffer | string]> {
    const path = new URL(url, "http://localhost").pathname;
    const file = normalize(join(this.dist, path === "/" ? "index.html" : path));
    if (!file.startsWith(this.dist)) return [404, "text/plain", "not found"];
    try {
      return [200, TYPES[extname(file)] ?? "application/octet-stream", await readFile(file)];
    } catch {
      return [404, "text/plain", "not found"];
    }
  }

  private join(socket: WebSocket): void {
    const client: Client = { socket, number: ++this.numbers, value: null, contacts: false, held: false, sent: new Set() };
    this.clients.add(client);
    socket.on("close", () => {
      this.clients.delete(client);
      for (const seat of Object.keys(this.seats)) if (this.seats[seat] === client.number) this.seats[seat] = null;
    });
    socket.on("message", (data) => this.receive(client, JSON.parse(String(data)) as Message));
    this.send(client, {
      type: "hello", version: 1, program: "0.1.0", client: client.number, source: { kind: this.kind, name: "cell-a" },
      policies: ["scripted", "noise", "operator"], record: this.record, seats: this.seats, speeds: [], command_life_ms: COMMAND_LIFE_MS,
    });
    this.sendStatus(client);
    this.sendScene(client);
    this.sendOrgans(client);
    this.sendFrame(client);
  }

  private tick(): void {
    this.ticks += 1;
    this.expire();
    if (this.playing && this.mode !== "ended") {
      const periods = this.speed === 0 ? 8 : this.speed >= 1 ? this.speed : this.ticks % Math.round(1 / this.speed) === 0 ? 1 : 0;
      for (let i = 0; i < periods; i += 1) this.cell.period();
      // A frame for each third tick: browsers that draw in software are slow clients.
      if (periods > 0 && this.ticks % 3 === 0) this.sendFrames();
    }
    if (this.ticks % 15 === 0) this.tellStatus();
  }

  private expire(): void {
    for (const arm of this.cell.arms) {
      if (arm.actor !== "operator" || performance.now() - arm.commandAt < COMMAND_LIFE_MS) continue;
      arm.actor = "hold";
      arm.target = [...arm.tip];
      this.tellStatus();
    }
  }

  private receive(client: Client, message: Message): void {
    this.received.push(message);
    if (this.received.length > 5000) this.received.splice(0, 1000);
    const request = message["request"];
    const done = (more: object = {}): void => {
      if (request !== undefined) this.send(client, { type: "done", request, ...more });
    };
    const refuse = (code: string, text: string): void => this.send(client, { type: "error", request: request ?? null, code, message: text });
    const needs = CONTROLS.has(message.type) ? "controls" : ARM.has(message.type) ? String(message["arm"]) : null;
    if (needs && this.seats[needs] !== client.number) return refuse("seat", `You do not have the seat '${needs}'.`);
    switch (message.type) {
      case "subscribe":
        client.value = (message["value"] as string | null) ?? null;
        client.contacts = message["contacts"] === true;
        client.held = message["held"] === true;
        client.sent.clear();
        this.sendFrame(client);
        return done();
      case "seats": {
        const taken = (message["take"] as string[]).filter((seat) => this.seats[seat] !== null && this.seats[seat] !== client.number);
        if (taken.length > 0) return refuse("seat", `Client ${this.seats[taken[0]!]} has the seat '${taken[0]}'.`);
        for (const seat of message["take"] as string[]) this.seats[seat] = client.number;
        for (const seat of message["give"] as string[]) if (this.seats[seat] === client.number) this.seats[seat] = null;
        this.tell({ type: "seats", ...this.seats });
        return done();
      }
      case "history": {
        const names = message["channels"] as string[];
        const places = names.map((name) => CHANNELS.indexOf(name));
        const { rows } = this.cell;
        return this.sendBinary(client, { type: "history", request, channels: names, from_s: 0 }, {
          time: [Float32Array.from(rows.map((row) => row[0]!)), 1],
          rows: [Float32Array.from(rows.flatMap((row) => places.map((k) => row[k] ?? Number.NaN))), names.length],
        });
      }
      case "picture":
        return this.sendBinary(client, { ...message, type: "picture", time_s: this.cell.time, format: "png" }, { file: [new Uint8Array(PICTURE), 1] });
      case "table":
        return this.sendTable(client);
      case "record":
        this.cell.reset();
        if (message["action"] !== "redo") this.seed += 1;
        if (message["action"] === "keep") this.kept += 1;
        this.sendFrames();
        this.tellStatus();
        return done(message["action"] === "keep" ? { path: `/tmp/demonstrations/${String(this.kept).padStart(6, "0")}`, passed: true } : {});
      default:
        if (needs === "controls") this.control(message);
        else if (needs) this.servo(message);
        return done();
    }
  }

  private control(message: Message): void {
    if (message.type === "play") this.playing = true;
    if (message.type === "pause") this.playing = false;
    if (message.type === "speed") this.speed = Number(message["factor"]);
    if (message.type === "step") {
      this.playing = false;
      this.cell.period();
    }
    if (message.type === "reset") {
      this.seed = Number(message["seed"] ?? this.seed);
      this.policy = String(message["policy"] ?? this.policy);
      this.mode = "live";
      this.cell.reset();
    }
    if (message.type === "seek") this.cell.seek(Math.round(Number(message["time_s"]) * 30));
    if (message.type === "open" || message.type === "live") {
      this.open = message.type === "open" ? String(message["episode"]) : null;
      this.mode = this.open ? "review" : "live";
      this.cell.reset();
      for (const client of this.clients) this.sendTable(client);
    }
    this.sendFrames();
    this.tellStatus();
  }

  private servo(message: Message): void {
    const arm = this.cell.arms[message["arm"] === "left" ? 0 : 1]!;
    if (message.type === "hand_back") arm.actor = "policy";
    if (message.type === "release") {
      arm.actor = arm.actor === "operator" ? "hold" : arm.actor;
      arm.target = [...arm.tip];
    }
    if (message.type === "servo_cr" || message.type === "servo_jp") {
      const seq = Number(message["seq"]);
      if (seq <= arm.seq) return;
      Object.assign(arm, { actor: "operator", seq, time_s: message["time_s"], commandAt: performance.now() });
    }
    if (message.type === "servo_cr") {
      if (message["clutch"] !== arm.clutch) Object.assign(arm, { clutch: message["clutch"], anchor: [...arm.target] });
      const t = (message["translation_m"] as number[]).map((v) => v * Number(message["scale"]));
      // The endoscope of the fake looks along +y and down by its pose's half turn: x stays, y is up, z away.
      const moved = message["frame"] === "endoscope" ? [t[0]!, t[2]!, -t[1]!] : t;
      arm.target = arm.anchor.map((v, k) => v + moved[k]!);
      if (typeof message["jaw"] === "number") arm.jawTarget = message["jaw"];
    }
    if (message.type === "servo_jp") arm.jawTarget = (message["positions"] as number[])[4] ?? arm.jawTarget;
    this.tellStatus();
  }

  private status(): Message {
    const { time } = this.cell;
    return {
      type: "status", phase: "ready", message: null, scene: this.scene, seed: this.seed, policy: this.policy, playing: this.playing,
      mode: this.mode, speed_target: this.speed, speed_actual: this.playing ? this.speed || 7.6 : 0, time_s: time, head_s: time,
      length_s: LENGTH_S, seekable_s: this.open ? LENGTH_S : time, end: null, passed: false, score: 0.41,
      actors: { left: this.cell.arms[0]!.actor, right: this.cell.arms[1]!.actor }, exact: this.open ? true : null, differs_s: null,
      record: { folder: this.record, state: "open", path: null }, seats: this.seats, note: null,
    };
  }

  private sendStatus(client: Client): void {
    this.send(client, this.status());
  }

  private tellStatus(): void {
    this.tell(this.status());
  }

  private sendScene(client: Client): void {
    const arrays: Record<string, [Packed, number]> = {};
    const meshes = MESHES.map(({ name, color, wet, metal, mesh }, i) => {
      arrays[`${i}.v`] = [mesh.vertices, 3];
      arrays[`${i}.t`] = [mesh.triangles, 3];
      return { name, color, roughness: 0.35, metal, wet, vertices: `${i}.v`, triangles: `${i}.t`, colors: null };
    });
    const pose = [0, 0, 0, 1, 0, 0, 0];
    const arm = (name: string, kind: string, port: number): object => ({
      name, kind, instrument: kind, port, drive: "dynamics", numbers: NUMBERS, low: LOW, high: HIGH, jaw_max_rad: 1.05,
      blade_length_m: 0.021, shaft_radius_m: 0.0025, has_joints: false,
    });
    const half = Math.SQRT1_2;
    const camera = (name: string, endoscope: boolean, at: number[]): object => ({
      name, endoscope, pose: at, fx: 640, fy: 640, cx: 640, cy: 360, width: 1280, height: 720, distortion: endoscope ? [] : [0.1, 0, 0, 0, 0, 0, 0, 0], circle: null,
    });
    this.sendBinary(client, {
      type: "scene", scene: this.scene, name: "cell-a", control_hz: 30, tissue_hz: 60, seed: this.seed,
      task: { name: "appendix-resection", summary: "grasp the organ, lift it, and cut it", organ: "appendix", prompt: "" },
      arms: [arm("left", "grasper", 0), arm("right", "cutter", 1)], ports: PORTS, rcm_mm: { threshold: 3, abort: 5 }, force_limit_n: 10,
      cameras: [camera("endoscope", true, [0, 0.36, 0.05, half, -half, 0, 0]), camera("d405", false, [0, 0.46, 0.35, 0, 1, 0, 0])],
      channels: CHANNELS, gates: [{ name: "gates.lift_mm", value: 8 }, { name: "gates.lift_s", value: 0.5 }],
      stages: [
        { name: "grasp", when: "grasped", weight: 1, channels: ["grasped"] },
        { name: "lift", when: "grasped and lift_mm >= gates.lift_mm for gates.lift_s", weight: 1, channels: ["lift_mm"] },
      ],
      aborts: [], arm_columns: COLUMNS, meshes,
      bodies: [
        { name: "table", mesh: 0, arm: null, part: "fixed", pose }, { name: "field", mesh: 1, arm: null, part: "fixed", pose },
        ...[0, 1].flatMap((i) => [
          { name: "shaft", mesh: 2, arm: i, part: "shaft", pose }, { name: "blade", mesh: 3, arm: i, part: "blade", pose },
        ]),
      ],
    }, arrays);
  }

  private sendOrgans(client: Client): void {
    const arrays: Record<string, [Packed, number]> = {};
    const organs = ORGANS.map(({ name, color, mesh }, i) => {
      const count = mesh.vertices.length / 3;
      arrays[`${i}.v`] = [mesh.vertices, 3];
      arrays[`${i}.t`] = [mesh.triangles, 3];
      arrays[`${i}.c`] = [Uint8Array.from({ length: 3 * count }, (_, k) => color[k % 3]! + ((k * 7) % 11)), 3];
      arrays[`${i}.p`] = [mesh.vertices.slice(0, 60), 3];
      return { name, count, triangles: `${i}.t`, colors: `${i}.c`, rest: `${i}.v`, young_modulus_pa: 12000, pins: `${i}.p` };
    });
    client.sent.clear();
    this.sendBinary(client, { type: "organs", scene: this.scene, topology: this.topology, organs }, arrays);
  }

  private sendFrames(): void {
    if (this.silent) return;
    this.frames += 1;
    for (const client of this.clients) this.sendFrame(client);
  }

  private sendFrame(client: Client): void {
    const { cell } = this;
    const arrays: Record<string, [Packed, number]> = {};
    const organs: object[] = [];
    ORGANS.forEach((organ, i) => {
      if (!organ.moves && client.sent.has(i)) return;
      client.sent.add(i);
      const positions = cell.organ(i);
      const low = [0, 1, 2].map((k) => Math.min(...positions.filter((_, j) => j % 3 === k)));
      const step = [0, 1, 2].map((k) => (Math.max(...positions.filter((_, j) => j % 3 === k)) - low[k]!) / 65535 || 1e-9);
      arrays[`${i}.x`] = [Uint16Array.from(positions, (v, k) => Math.round((v - low[k % 3]!) / step[k % 3]!)), 3];
      if (client.value) arrays[`${i}.o`] = [Uint8Array.from({ length: positions.length / 3 }, (_, k) => (k * 3) % 256), 1];
      organs.push({ organ: i, low, step, positions: `${i}.x`, ...(client.value ? { values: `${i}.o` } : {}) });
    });
    const poses = [0, 1].flatMap((i) => [...cell.pose(i), ...cell.pose(i)]);
    arrays["poses"] = [Float32Array.from(poses), 7];
    arrays["arms"] = [cell.columns(), COLUMNS.length];
    if (cell.rows.length > 0) arrays["row"] = [Float32Array.from(cell.rows.at(-1)!), 1];
    arrays["stages"] = [Float32Array.from([cell.passedAt[0]! >= 0 ? 1 : 0, 0.6, cell.passedAt[0]!, 0, cell.lift() / 10, -1]), 3];
    if (client.contacts) arrays["contacts"] = [Float32Array.from([0, 0.455, 0.055, 0, 0, -0.3, 0, 0, 0.005, 0.452, 0.054, 0.1, 0, -0.2, 0, 0]), 8];
    if (client.held) arrays["held"] = [Float32Array.from([-0.02, 0.455, 0.05, 0, -0.018, 0.456, 0.051, 0, -0.019, 0.457, 0.05, 0]), 4];
    const commands = Object.fromEntries(["left", "right"].map((name, i) => {
      const { seq, time_s } = cell.arms[i]!;
      return [name, seq > 0 ? { seq, time_s, waited_ms: 8, step_ms: 3 } : null];
    }));
    this.sendBinary(client, {
      type: "frame", frame: this.frames, scene: this.scene, topology: this.topology, step: cell.step, part: 2, parts: 2, time_s: cell.time,
      mode: this.mode, stage: "lift", organs, commands, dropped: 0, actors: { left: cell.arms[0]!.actor, right: cell.arms[1]!.actor },
      value: client.value ? { kind: client.value, low: client.value === "stretch" ? 1 : 0, high: client.value === "stretch" ? 1.5 : 900, unit: client.value === "stretch" ? "" : "J/m3" } : null,
    }, arrays);
  }

  private sendTable(client: Client): void {
    const episode = (id: string, passed: boolean, end: string): object => ({
      id, policy: id.split("/")[0], seed: Number(id.split("/")[1]), passed, end, score: passed ? 1 : 0.6, stage: "lift", duration_s: 12.4, why: "out of reach",
    });
    this.send(client, {
      type: "table", kind: "campaign", name: "campaign", open: this.open,
      episodes: [episode("scripted/000003", false, "time-out"), episode("noise/000001", false, "rcm-abort"), episode("scripted/000001", true, "passed")],
    });
  }

  private send(client: Client, message: object): void {
    client.socket.send(JSON.stringify(message));
  }

  private tell(message: object): void {
    for (const client of this.clients) this.send(client, message);
  }

  private sendBinary(client: Client, header: Record<string, unknown>, arrays: Record<string, [Packed, number]>): void {
    client.socket.send(pack(header, arrays));
  }
}

const CONTROLS = new Set(["play", "pause", "step", "speed", "reset", "seek", "open", "live", "record"]);
const ARM = new Set(["servo_cr", "servo_cp", "servo_jp", "servo_jaw", "release", "hand_back"]);
