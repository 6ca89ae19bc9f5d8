/** Reads the wire's binary messages: a length, a JSON header, and arrays that lie on the message. */

export type Numbers = Float32Array | Uint32Array | Uint16Array | Uint8Array;

interface ArrayHeader {
  dtype: string;
  shape: number[];
  offset: number;
}

/** A binary message: its header, and its arrays by name. */
export class Binary {
  readonly header: Record<string, unknown> & { type: string };
  private readonly arrays: Record<string, ArrayHeader>;
  private readonly data: number;

  /** Throws where the message is not whole. */
  constructor(private readonly buffer: ArrayBuffer) {
    if (buffer.byteLength < 4) throw new Error("a binary message must have at least 4 bytes");
    const length = new DataView(buffer).getUint32(0, true);
    if (4 + length > buffer.byteLength) throw new Error(`a header of ${length} bytes is longer than its message`);
    const text = new TextDecoder("utf-8", { fatal: true }).decode(new Uint8Array(buffer, 4, length));
    const header: unknown = JSON.parse(text);
    if (!isRecord(header) || typeof header["type"] !== "string") throw new Error("a header must have a type");
    this.header = header as Record<string, unknown> & { type: string };
    this.arrays = (isRecord(header["arrays"]) ? header["arrays"] : {}) as unknown as Record<string, ArrayHeader>;
    this.data = 4 + length;
  }

  has(name: string): boolean {
    return Object.hasOwn(this.arrays, name);
  }

  /** Rows of an array: the first number of its shape. */
  rows(name: string): number {
    return this.has(name) ? (this.arrays[name]?.shape[0] ?? 0) : 0;
  }

  f32(name: string): Float32Array {
    return this.take(name, "f32", Float32Array);
  }

  u32(name: string): Uint32Array {
    return this.take(name, "u32", Uint32Array);
  }

  u16(name: string): Uint16Array {
    return this.take(name, "u16", Uint16Array);
  }

  u8(name: string): Uint8Array {
    return this.take(name, "u8", Uint8Array);
  }

  private take<T extends Numbers>(name: string, dtype: string, make: NumbersConstructor<T>): T {
    const array = this.has(name) ? this.arrays[name] : undefined;
    if (!array) throw new Error(`${this.header.type} has no array '${name}'`);
    if (array.dtype !== dtype) throw new Error(`array '${name}' is ${array.dtype}; it must be ${dtype}`);
    const count = array.shape.reduce((a, b) => a * b, 1);
    const begin = this.data + array.offset;
    const bytes = count * make.BYTES_PER_ELEMENT;
    const whole = Number.isSafeInteger(count) && count >= 0 && array.offset >= 0;
    if (!whole || begin + bytes > this.buffer.byteLength) throw new Error(`array '${name}' is longer than its message`);
    if (begin % make.BYTES_PER_ELEMENT === 0) return new make(this.buffer, begin, count);
    return new make(this.buffer.slice(begin, begin + bytes), 0, count);
  }
}

interface NumbersConstructor<T> {
  new (buffer: ArrayBuffer, offset: number, length: number): T;
  readonly BYTES_PER_ELEMENT: number;
}

/** Whether a value is a JSON object. */
export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** Positions (m) from 16-bit steps of a box, into `into`. */
export function dequantise(low: number[], step: number[], from: Uint16Array, into: Float32Array): void {
  const [lx = 0, ly = 0, lz = 0] = low;
  const [sx = 0, sy = 0, sz = 0] = step;
  const end = Math.min(from.length, into.length);
  for (let i = 0; i + 2 < end; i += 3) {
    into[i] = lx + sx * from[i]!;
    into[i + 1] = ly + sy * from[i + 1]!;
    into[i + 2] = lz + sz * from[i + 2]!;
  }
}
