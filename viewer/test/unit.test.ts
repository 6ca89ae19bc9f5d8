/** Tests of what needs no browser: the wire's reader, texts, clutch, axis test. */

import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { distorted, ideal } from "../src/scene/lens.ts";
import { AxisTest } from "../src/teleop/axis-test.ts";
import { Clutch, type Anchor } from "../src/teleop/clutch.ts";
import { atRest, axesOf, type Device } from "../src/teleop/device.ts";
import { channel, number, speed, title } from "../src/ui/format.ts";
import { withThresholds } from "../src/ui/thresholds.ts";
import { Binary, dequantise } from "../src/wire/binary.ts";
import { pack } from "./fake/pack.ts";

function buffer(message: Buffer): ArrayBuffer {
  return new Uint8Array(message).buffer;
}

test("a binary message gives its arrays without a copy", () => {
  const packed = buffer(pack({ type: "frame", step: 3 }, { "0.x": [Uint16Array.of(1, 2, 3), 3], poses: [Float32Array.of(1, 2.5, 3), 1] }));
  const message = new Binary(packed);
  assert.equal(message.header.type, "frame");
  assert.equal(message.header["step"], 3);
  assert.deepEqual([...message.u16("0.x")], [1, 2, 3]);
  assert.deepEqual([...message.f32("poses")], [1, 2.5, 3]);
  assert.equal(message.f32("poses").buffer, packed);
  assert.equal(message.rows("poses"), 3);
  assert.equal(message.has("toString"), false);
});

test("a lens bends as OpenCV does, and back", () => {
  const k = [-0.3, 0.1, 0.001, -0.002, 0.01, 0.02, -0.01, 0.005];
  // By projectPoints of OpenCV 5.
  const [u, v] = distorted(k, 0.4, -0.3);
  assert.ok(Math.hypot(u - 0.36953078789764343, v + 0.2772730909232326) < 1e-12, `${u} ${v}`);
  const [x = 0, y = 0] = ideal(k, u, v) ?? [];
  assert.ok(Math.hypot(x - 0.4, y + 0.3) < 1e-8, `${x} ${y}`);
  assert.equal(ideal([-0.3, 0, 0, 0], 3, 0), null, "beyond the fold there is nothing");
});

test("damaged binary messages are errors, never half-read", () => {
  const whole = pack({ type: "frame" }, { a: [Float32Array.of(1, 2, 3, 4), 1] });
  for (let length = 0; length < whole.length; length += 1) {
    assert.throws(() => new Binary(buffer(whole.subarray(0, length))).f32("a"), `${length} of ${whole.length} bytes`);
  }
  assert.throws(() => new Binary(buffer(whole)).u16("a"), /is f32; it must be u16/);
  assert.throws(() => new Binary(buffer(whole)).f32("b"), /no array 'b'/);
  const header = Buffer.from(JSON.stringify({ type: "x", arrays: { a: { dtype: "f32", shape: [2, -3], offset: 0 }, b: { dtype: "f32", shape: [1e9, 1e9], offset: 0 } } }));
  const odd = Buffer.concat([Buffer.from(Uint32Array.of(header.length).buffer), header, Buffer.alloc(64)]);
  for (const name of ["a", "b"]) assert.throws(() => new Binary(buffer(odd)).f32(name), /longer than its message/);
});

test("an array that does not lie on its alignment is copied", () => {
  const header = Buffer.from(JSON.stringify({ type: "x", arrays: { a: { dtype: "f32", shape: [1], offset: 0 } } }));
  const data = Buffer.from(Float32Array.of(7).buffer);
  for (const padding of [0, 1, 2, 3]) {
    const padded = Buffer.concat([header, Buffer.alloc(padding, " ")]);
    const message = Buffer.concat([Buffer.from(Uint32Array.of(padded.length).buffer), padded, data]);
    assert.deepEqual([...new Binary(buffer(message)).f32("a")], [7]);
  }
});

test("positions are low + step * u", () => {
  const into = new Float32Array(6);
  dequantise([1, 2, 3], [0.5, 0.25, 0.125], Uint16Array.of(0, 4, 8, 2, 0, 16), into);
  assert.deepEqual([...into], [1, 3, 4, 2, 2, 5]);
});

test("numbers and names are written as people read them", () => {
  assert.equal(number(-0.0001, 2), "0.00");
  assert.equal(number(Number.NaN, 2, "N"), "–");
  assert.equal(speed(0.125), "1/8");
  assert.equal(speed(0), "Fastest");
  assert.equal(title("jaw-on-tissue"), "Jaw on tissue");
  assert.deepEqual(channel("left_jaw_force_n"), { label: "Left jaw force", unit: "N" });
  assert.deepEqual(channel("left_rcm_mm"), { label: "Left RCM", unit: "mm" });
  assert.equal(
    withThresholds("lift_mm >= gates.lift_mm for gates.lift_s and gates.unknown", [{ name: "gates.lift_mm", value: 8 }, { name: "gates.lift_s", value: 0.5 }]),
    "lift_mm >= 8 mm for 0.5 s and gates.unknown",
  );
});

const HALF = Math.SQRT1_2;
const STRAIGHT_DOWN = [0, 0, 0, HALF, 0, HALF, 0];

function anchor(change: Partial<Anchor> = {}): Anchor {
  return { pose: STRAIGHT_DOWN, jaw: 0.5, frame: "world", camera: null, scale: 0.5, ...change };
}

test("a clutch sends the whole motion since its press, before scaling", () => {
  const clutch = new Clutch(4, anchor());
  const push = { ...atRest(), rates: { right: 1, up: 0, deeper: 0, roll: 0, jaw: 0 } };
  for (let i = 0; i < 10; i += 1) clutch.move(push, 0.01, new THREE.Vector3());
  const message = clutch.message("left", 12);
  assert.equal(message.clutch, 4);
  assert.equal(message.seq, 12);
  assert.equal(message.scale, 0.5);
  assert.ok(Math.abs(message.translation_m[0] - 0.008) < 1e-9);
  assert.deepEqual(message.rotation_wxyz.map((v) => v + 0), [1, 0, 0, 0]);
  assert.equal(message.jaw, 0.5);
});

test("the wanted place does not run away from an arm that is held back", () => {
  const clutch = new Clutch(1, anchor({ scale: 1 }));
  const push = { ...atRest(), rates: { right: 1, up: 0, deeper: 0, roll: 0, jaw: 0 } };
  let free = true;
  for (let i = 0; i < 200; i += 1) free = clutch.move(push, 0.02, new THREE.Vector3());
  assert.equal(free, false);
  assert.ok(clutch.translation.length() < 0.0301);
  const back = { ...push, rates: { ...push.rates, right: -1 } };
  assert.equal(clutch.move(back, 0.02, new THREE.Vector3()), true);
});

test("a roll turns about the shaft in the axes of the frame", () => {
  const turn = { ...atRest(), rates: { right: 0, up: 0, deeper: 0, roll: 1, jaw: 0 } };
  const inWorld = new Clutch(1, anchor());
  inWorld.move(turn, 0.05, new THREE.Vector3());
  const [, x, y, z] = inWorld.message("left", 1).rotation_wxyz;
  // The shaft points down: a turn about -z.
  assert.ok(Math.abs(x) < 1e-9 && Math.abs(y) < 1e-9 && z < 0);
  const inTool = new Clutch(1, anchor({ frame: "tool" }));
  inTool.move(turn, 0.05, new THREE.Vector3());
  assert.ok(inTool.message("left", 1).rotation_wxyz[1] > 0);
});

test("a trigger takes the jaw only where it meets it", () => {
  const clutch = new Clutch(1, anchor({ jaw: 0.2 }));
  const trigger = (opening: number) => clutch.move({ ...atRest(), opening }, 0.02, new THREE.Vector3());
  trigger(1);
  assert.equal(clutch.message("left", 1).jaw, 0.2, "a released trigger does not open a closed jaw");
  trigger(0.6);
  assert.equal(clutch.message("left", 2).jaw, 0.2);
  trigger(0.1);
  assert.equal(clutch.message("left", 3).jaw, 0.1, "it has passed the jaw");
  trigger(0.7);
  assert.equal(clutch.message("left", 4).jaw, 0.7);
});

test("an axis test ends when every axis went both ways, and turns axes round", () => {
  const device: Device = {
    id: "fake", name: "Fake", hint: "", present: true, axes: axesOf("fake", 0, ""), read: () => [atRest(), atRest()], clear: () => undefined,
  };
  const axes = new AxisTest(device);
  for (const sign of [1, -1]) {
    for (const axis of device.axes) {
      assert.equal(axes.done, false);
      const reading = atRest();
      reading.rates[axis.name] = sign;
      axes.step([reading, atRest()]);
    }
  }
  assert.equal(axes.done, true);
  axes.flip(device.axes[0]!, true);
  assert.equal(axes.done, false, "a turned axis is tested again");
  const reading = atRest();
  reading.rates.right = 1;
  assert.equal(axes.step([reading, atRest()])[0], -1);
  assert.equal(axes.correct([reading, atRest()])[0]!.rates.right, -1);
});
