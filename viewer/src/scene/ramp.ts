/** The colours of a value: dark violet to yellow, with linearly increasing lightness, as in the reports. */

const STOPS = [
  [66, 10, 90], [66, 62, 133], [46, 104, 142], [32, 144, 140], [57, 182, 118], [145, 213, 66], [250, 230, 40],
] as const;

const LINEAR = (() => {
  const table = new Float32Array(256 * 3);
  for (let v = 0; v < 256; v += 1) {
    const x = (v / 255) * (STOPS.length - 1);
    const i = Math.min(Math.floor(x), STOPS.length - 2);
    for (let c = 0; c < 3; c += 1) {
      const srgb = (STOPS[i]![c]! * (1 - (x - i)) + STOPS[i + 1]![c]! * (x - i)) / 255;
      table[3 * v + c] = srgb <= 0.04045 ? srgb / 12.92 : ((srgb + 0.055) / 1.055) ** 2.4;
    }
  }
  return table;
})();

/** Linear colours of values (0 to 255), into `into`. */
export function ramp(values: Uint8Array, into: Float32Array): void {
  const end = Math.min(values.length, into.length / 3);
  for (let i = 0; i < end; i += 1) {
    const v = 3 * values[i]!;
    into[3 * i] = LINEAR[v]!;
    into[3 * i + 1] = LINEAR[v + 1]!;
    into[3 * i + 2] = LINEAR[v + 2]!;
  }
}

/** The ramp as a CSS gradient, for legends. */
export const RAMP_CSS = `linear-gradient(to right, ${STOPS.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;
