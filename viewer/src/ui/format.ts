/** Numbers and names as the page writes them. */

/** A number with fixed decimals; a dash where there is none. */
export function number(value: number | null | undefined, decimals: number, unit = ""): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Math.abs(value) < 0.5 * 10 ** -decimals ? (0).toFixed(decimals) : value.toFixed(decimals);
  return unit ? `${text} ${unit}` : text;
}

/** Seconds of an episode. */
export function seconds(value: number): string {
  return number(value, 2, "s");
}

/** A speed as a multiple of real time. */
export function speed(value: number): string {
  if (value === 0) return "Fastest";
  if (value < 1) return `1/${Math.round(1 / value)}`;
  return `${value}x`;
}

/** A name as a text: `jaw-on-tissue` is "Jaw on tissue". */
export function title(name: string): string {
  const words = name.replace(/[-_]+/g, " ").trim();
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** A text as a sentence: its first letter is a capital, and it ends with a full stop. */
export function sentence(text: string): string {
  const begun = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(begun) ? begun : `${begun}.`;
}

const UNITS: [ending: string, unit: string][] = [
  ["_rad_s", "rad/s"], ["_m_s", "m/s"], ["_mm", "mm"], ["_nm", "N m"], ["_rad", "rad"], ["_m", "m"], ["_n", "N"], ["_s", "s"],
];

/** A channel's name and unit: `left_contact_x_n` is "Left contact x" in N. */
export function channel(name: string): { label: string; unit: string } {
  if (name === "grasp_s") return { label: "Grasp s", unit: "" };
  for (const [ending, unit] of UNITS) {
    if (name.endsWith(ending)) return { label: title(name.slice(0, -ending.length)).replace("rcm", "RCM"), unit };
  }
  return { label: title(name).replace("rcm", "RCM"), unit: "" };
}
