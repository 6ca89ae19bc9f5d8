/** What an input device gives the operator's arms, and its axes as the axis test shows them. */

/** The motions of one arm that a device can make, each -1 to 1. */
export type AxisName = "right" | "up" | "deeper" | "roll" | "jaw";

/** What a device says at one moment for one arm. */
export interface Reading {
  /** Whether the clutch is held. */
  clutch: boolean;
  /** Rates, -1 to 1 of the fastest; `jaw` above 0 opens. */
  rates: Record<AxisName, number>;
  /** The jaw's opening where the device has a place for it (a trigger), 0 to 1. */
  opening: number | null;
}

/** One axis of a device as the axis test shows it. */
export interface DeviceAxis {
  id: string;
  label: string;
  /** What the two ends are called. */
  ends: [low: string, high: string];
  arm: number;
  name: AxisName;
}

export interface Device {
  readonly id: string;
  readonly name: string;
  /** What to do, in one sentence. */
  readonly hint: string;
  /** Whether it is there. */
  readonly present: boolean;
  readonly axes: DeviceAxis[];
  /** What it says for each arm (left first), before axes are turned round. */
  read(): Reading[];
  /** Forgets what is pressed. */
  clear(): void;
}

export const REST: Readonly<Record<AxisName, number>> = { right: 0, up: 0, deeper: 0, roll: 0, jaw: 0 };

/** A reading in which nothing is pressed. */
export function atRest(): Reading {
  return { clutch: false, rates: { ...REST }, opening: null };
}

/** The axes of one arm, in the axis test's words. */
export function axesOf(device: string, arm: number, prefix: string): DeviceAxis[] {
  const axis = (name: AxisName, label: string, ends: [string, string]): DeviceAxis => ({
    id: `${device}-${arm}-${name}`, label: prefix ? `${prefix} ${label.toLowerCase()}` : label, ends, arm, name,
  });
  return [
    axis("right", "Sideways", ["left", "right"]),
    axis("up", "Height", ["down", "up"]),
    axis("deeper", "Depth", ["back", "deeper"]),
    axis("roll", "Roll", ["left", "right"]),
    axis("jaw", "Jaw", ["close", "open"]),
  ];
}
