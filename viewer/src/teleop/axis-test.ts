/** The axis test: each axis is moved both ways before its device drives an arm; axes can be turned round. */

import type { Device, DeviceAxis, Reading } from "./device.ts";

/** An axis counts as moved beyond this share of its range. */
const MOVED = 0.5;

export class AxisTest {
  private readonly seen = new Map<string, { low: boolean; high: boolean }>();
  private readonly flipped = new Set<string>();

  constructor(readonly device: Device) {
    for (const axis of device.axes) this.seen.set(axis.id, { low: false, high: false });
  }

  /** Values of all axes as the arm would get them; notes which ends were reached. */
  step(readings: Reading[]): number[] {
    return this.device.axes.map((axis) => {
      const value = this.value(axis, readings);
      const seen = this.seen.get(axis.id);
      if (seen && value > MOVED) seen.high = true;
      if (seen && value < -MOVED) seen.low = true;
      return value;
    });
  }

  flip(axis: DeviceAxis, on: boolean): void {
    if (on) this.flipped.add(axis.id);
    else this.flipped.delete(axis.id);
    this.seen.set(axis.id, { low: false, high: false });
  }

  isFlipped(axis: string): boolean {
    return this.flipped.has(axis);
  }

  /** How many of the two ends of an axis were reached. */
  ends(axis: DeviceAxis): number {
    const seen = this.seen.get(axis.id);
    return Number(seen?.low ?? false) + Number(seen?.high ?? false);
  }

  get done(): boolean {
    return this.device.axes.every((axis) => this.ends(axis) === 2);
  }

  /** The device's readings with the axes that are turned round. */
  correct(readings: Reading[]): Reading[] {
    return readings.map((reading, arm) => {
      const rates = { ...reading.rates };
      let opening = reading.opening;
      for (const axis of this.device.axes) {
        // A device with the axes of one arm uses them for the arm that it moves.
        if ((axis.arm !== arm && this.armsOfDevice > 1) || !this.flipped.has(axis.id)) continue;
        rates[axis.name] = -rates[axis.name];
        if (axis.name === "jaw" && opening !== null) opening = 1 - opening;
      }
      return { ...reading, rates, opening };
    });
  }

  private get armsOfDevice(): number {
    return new Set(this.device.axes.map((axis) => axis.arm)).size;
  }

  private value(axis: DeviceAxis, readings: Reading[]): number {
    const value = readings[axis.arm]?.rates[axis.name] ?? 0;
    return this.flipped.has(axis.id) ? -value : value;
  }
}
