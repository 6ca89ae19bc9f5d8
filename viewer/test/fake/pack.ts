/** Packs the wire's binary messages, as the reference documents them. Written apart from the page's reader. */

export type Packed = Float32Array | Uint32Array | Uint16Array | Uint8Array;

const DTYPES = new Map<string, string>([
  ["Float32Array", "f32"], ["Uint32Array", "u32"], ["Uint16Array", "u16"], ["Uint8Array", "u8"],
]);

/** A message of a header and arrays; each array has its width (1: a plain list). */
export function pack(header: Record<string, unknown>, arrays: Record<string, [data: Packed, width: number]>): Buffer {
  const described: Record<string, unknown> = {};
  let offset = 0;
  for (const [name, [data, width]] of Object.entries(arrays)) {
    const rows = width === 1 ? [data.length] : [data.length / width, width];
    described[name] = { dtype: DTYPES.get(data.constructor.name), shape: rows, offset };
    offset += Math.ceil(data.byteLength / 8) * 8;
  }
  let text = JSON.stringify({ ...header, arrays: described });
  const bytes = Buffer.byteLength(text);
  text += " ".repeat((8 - ((4 + bytes) % 8)) % 8);
  const head = Buffer.from(text);
  const message = Buffer.alloc(4 + head.length + offset);
  message.writeUInt32LE(head.length, 0);
  head.copy(message, 4);
  let at = 4 + head.length;
  for (const [data] of Object.values(arrays)) {
    Buffer.from(data.buffer, data.byteOffset, data.byteLength).copy(message, at);
    at += Math.ceil(data.byteLength / 8) * 8;
  }
  return message;
}
