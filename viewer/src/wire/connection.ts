/** The page's WebSocket: opens, opens again when it is lost, and matches replies to requests. */

import { Binary, isRecord } from "./binary.ts";
import { Emitter } from "./emitter.ts";
import type { WireError } from "./messages.ts";

export type Link = "connecting" | "open" | "lost" | "refused";

interface Events {
  link: Link;
  text: Record<string, unknown> & { type: string };
  binary: Binary;
  problem: string;
}

/** A reply: a text message, or a binary one. */
export type Reply = (Record<string, unknown> & { type: string }) | Binary;

interface Waiting {
  resolve: (reply: Reply) => void;
  reject: (error: Error) => void;
}

const RETRY_MS = [300, 600, 1200, 2500, 5000];
/** Bytes that may wait to be sent before a command is left out: old commands are of no use. */
const MAX_WAITING_BYTES = 16_384;

export class Connection extends Emitter<Events> {
  private socket: WebSocket | null = null;
  private readonly waiting = new Map<number, Waiting>();
  private requests = 0;
  private failures = 0;
  private closed = false;
  link: Link = "connecting";

  constructor(private readonly address: string) {
    super();
  }

  open(): void {
    this.set("connecting");
    const socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let opened = false;
    socket.addEventListener("open", () => {
      opened = true;
      this.set("open");
    });
    socket.addEventListener("message", (event) => {
      this.failures = 0;
      this.receive(event.data);
    });
    socket.addEventListener("close", () => {
      if (this.socket !== socket) return;
      this.socket = null;
      for (const { reject } of this.waiting.values()) reject(new Error("The connection was lost."));
      this.waiting.clear();
      this.failures += 1;
      this.set(!opened && this.failures > 3 ? "refused" : "lost");
      if (!this.closed) setTimeout(() => this.open(), RETRY_MS[Math.min(this.failures - 1, RETRY_MS.length - 1)]);
    });
  }

  close(): void {
    this.closed = true;
    this.socket?.close();
  }

  /** Sends a message; whether it was given to the socket. */
  send(message: { type: string }): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** Sends a command unless earlier ones still wait in the socket. */
  sendLatest(message: { type: string }): boolean {
    if ((this.socket?.bufferedAmount ?? 0) > MAX_WAITING_BYTES) return false;
    return this.send(message);
  }

  /** Sends a message and waits for its reply; an `error` rejects with its sentence. */
  request(message: { type: string; [key: string]: unknown }): Promise<Reply> {
    const request = ++this.requests;
    return new Promise((resolve, reject) => {
      this.waiting.set(request, { resolve, reject });
      if (this.send({ ...message, request } as { type: string })) return;
      this.waiting.delete(request);
      reject(new Error("Not connected."));
    });
  }

  private receive(data: unknown): void {
    try {
      const message: Reply = data instanceof ArrayBuffer ? new Binary(data) : parse(String(data));
      const fields = message instanceof Binary ? message.header : message;
      const request = fields["request"];
      const waits = typeof request === "number" ? this.waiting.get(request) : undefined;
      if (waits) {
        this.waiting.delete(request as number);
        if (fields.type === "error") waits.reject(new Error(String((fields as unknown as WireError).message)));
        else waits.resolve(message);
      }
      if (message instanceof Binary) this.emit("binary", message);
      else if (!(waits && fields.type === "error")) this.emit("text", message);
    } catch (error) {
      this.emit("problem", error instanceof Error ? error.message : String(error));
    }
  }

  private set(link: Link): void {
    this.link = link;
    this.emit("link", link);
  }
}

function parse(text: string): Record<string, unknown> & { type: string } {
  const value: unknown = JSON.parse(text);
  if (!isRecord(value) || typeof value["type"] !== "string") throw new Error("a message must have a type");
  return value as Record<string, unknown> & { type: string };
}
