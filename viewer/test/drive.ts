/** Driving in a browser, on the fake server: keyboard, mouse, gamepad, sliders; and what is lost lets go. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { at, findBrowser, launch } from "./browser.ts";
import { FAKE_GAMEPAD, unplug } from "./fake/gamepad.ts";
import type { FakeServer } from "./fake/server.ts";
import { eventually, expectSoon, inside, onFake, reach, says, testGamepad, testKeyboard, until } from "./harness.ts";

const skip = findBrowser() ? false : "no Chromium here; install it or name it in CHROMIUM";

test("driving", { skip }, async (t) => {
  let browser: Browser;
  let page: Page;
  let server: FakeServer;
  let errors: string[];
  let close: () => Promise<void>;
  before(async () => {
    browser = await launch();
    ({ server, page, errors, close } = await onFake(browser, {}, (page) => page.addInitScript(FAKE_GAMEPAD)));
  });
  after(() => close());

  const hold = (key: string) => page.keyboard.down(key);
  const letGo = (key: string) => page.keyboard.up(key);
  /** Presses the clutch with the focus in the view, until the arm is driven. */
  const engage = async () => {
    await letGo("Space");
    await at(page, "view").focus();
    await hold("Space");
    await expectSoon(() => inside(page, ({ drive }) => drive.operator.clutched), true, "the clutch is held");
  };
  const servo = () => server.of("servo_cr");

  await t.test("a device is of no use before each of its axes was moved both ways", async () => {
    await at(page, "tab-drive").click();
    await at(page, "device").selectOption("keyboard");
    await eventually(() => server.seats["left"] !== null && server.seats["right"] !== null, "the arms' seats");
    assert.equal(await at(page, "use-device").isDisabled(), true);
    await at(page, "view").focus();
    await hold("Space");
    await reach(page, "keyboard-0-right", () => hold("d"), () => letGo("d"));
    await letGo("Space");
    assert.equal(servo().length, 0, "nothing is sent during the test");
  });

  await t.test("the axis test shows the direction, and an axis can be turned round", async () => {
    const place = () => page.locator('[data-axis="keyboard-0-right"] i').evaluate((mark: HTMLElement) => Number.parseFloat(mark.style.left));
    await hold("d");
    await expectSoon(async () => (await place()) > 90, true, "D is to the right");
    await letGo("d");
    await at(page, "flip-keyboard-0-right").check();
    await hold("d");
    await expectSoon(async () => (await place()) < 10, true, "turned round");
    await letGo("d");
    await at(page, "flip-keyboard-0-right").uncheck();
  });

  await t.test("keys drive the left arm to a target while the clutch is held, and only then", async () => {
    await testKeyboard(page);
    await says(page, "drive-note", /Ready/);
    await at(page, "frame").selectOption("world");
    await at(page, "view").focus();
    await hold("d");
    await page.waitForTimeout(200);
    await letGo("d");
    assert.equal(servo().length, 0, "no clutch, no command");
    await hold("Space");
    await eventually(() => server.cell.arms[0]!.actor === "operator", "the arm is taken over");
    const begin = server.cell.arms[0]!.tip[0]!;
    await hold("a");
    await eventually(() => server.cell.arms[0]!.tip[0]! < begin - 0.015, "15 mm to the left");
    await letGo("a");
    await says(page, "drive-note", /Driving the left arm/);
    await says(page, "chip-actors", /Operator drives left arm/);
    await letGo("Space");
    await eventually(() => server.of("release").length > 0, "release");
    await eventually(() => server.cell.arms[0]!.actor === "hold", "hold");
    const message = servo().at(-1)!;
    assert.equal(message["arm"], "left");
    assert.equal(message["frame"], "world");
    assert.equal(message["scale"], 0.5);
    assert.equal(server.cell.arms[1]!.actor, "policy", "the other arm is the policy's");
  });

  await t.test("commands are numbered, timed, and a new press begins from zero", async () => {
    const all = servo();
    for (let i = 1; i < all.length; i += 1) assert.ok(Number(all[i]!["seq"]) > Number(all[i - 1]!["seq"]));
    await hold("Space");
    await eventually(() => Number(servo().at(-1)!["clutch"]) > Number(all.at(-1)!["clutch"]), "another clutch");
    const first = servo().find((message) => message["clutch"] === servo().at(-1)!["clutch"])!;
    assert.ok(Math.hypot(...(first["translation_m"] as number[])) < 1e-6, "motion is relative to the press");
    await letGo("Space");
  });

  await t.test("a key in the endoscope's frame moves along the picture", async () => {
    await at(page, "frame").selectOption("endoscope");
    await at(page, "view").focus();
    await hold("Space");
    await hold("w");
    await page.waitForTimeout(250);
    await letGo("w");
    await letGo("Space");
    const [x = 0, y = 0, z = 0] = servo().at(-1)!["translation_m"] as number[];
    assert.ok(y < 0 && x === 0 && z === 0, "up is -y in the endoscope's axes");
    assert.equal(servo().at(-1)!["camera"], "endoscope");
  });

  await t.test("the other arm by its key, its jaw by I and K", async () => {
    await page.keyboard.press("2");
    await expectSoon(() => at(page, "key-arm").inputValue(), "1", "the arm of the keys");
    await hold("Space");
    await hold("i");
    await eventually(() => server.cell.arms[1]!.jawTarget > 0.85, "the jaw opens");
    await letGo("i");
    await letGo("Space");
    await page.keyboard.press("1");
  });

  await t.test("a lost focus lets go, and the held key does not take the arm again", async () => {
    await engage();
    await page.evaluate(() => window.dispatchEvent(new Event("blur")));
    await says(page, "drive-note", /lost the focus/);
    const count = servo().length;
    await page.waitForTimeout(300);
    assert.equal(servo().length, count, "nothing is sent");
    await letGo("Space");
  });

  await t.test("a hidden page lets go", async () => {
    await engage();
    await page.evaluate(() => {
      Object.defineProperty(document, "hidden", { value: true, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    });
    await says(page, "drive-note", /page was hidden/);
    await page.evaluate(() => Reflect.deleteProperty(document, "hidden"));
    await letGo("Space");
  });

  await t.test("no picture for a second lets go", async () => {
    await engage();
    server.silent = true;
    await says(page, "drive-note", /No new picture/);
    server.silent = false;
    await letGo("Space");
  });

  await t.test("paused, the clutch does not engage and says why", async () => {
    await at(page, "play").click();
    await eventually(() => !server.playing, "pause");
    await letGo("Space");
    await at(page, "view").focus();
    await hold("Space");
    await says(page, "drive-note", /paused/);
    await letGo("Space");
    await at(page, "play").click();
    await eventually(() => server.playing, "play");
  });

  await t.test("an arm of another operator is not driven, and that is said", async () => {
    server.takeAway("left");
    await at(page, "view").focus();
    await page.waitForTimeout(100);
    await hold("Space");
    await says(page, "drive-note", /Another operator has the left arm/);
    await letGo("Space");
    server.seats["left"] = server.seats["right"]!;
    await until(page, ({ session }) => session.has("left"), "the seat is this page's again");
  });

  await t.test("hands back to the policy", async () => {
    await at(page, "hand-back").click();
    await eventually(() => server.cell.arms.every((arm) => arm.actor === "policy"), "the policy drives");
  });

  await t.test("keeps, discards and does again by button and by key", async () => {
    const seed = server.seed;
    await at(page, "keep").click();
    await says(page, "record-note", /Kept as 000001\. It passed\. 1 kept/);
    assert.equal(server.seed, seed + 1);
    await at(page, "view").focus();
    await page.keyboard.press("Backspace");
    await says(page, "record-note", /same seed/);
    assert.equal(server.seed, seed + 1);
    await page.keyboard.press("Delete");
    await says(page, "record-note", /Discarded/);
    await page.keyboard.press("Enter");
    await says(page, "record-note", /Kept as 000002/);
    assert.equal(server.kept, 2);
  });

  await t.test("a drag moves a tip in the view's plane, the wheel inserts", async () => {
    await at(page, "device").selectOption("mouse");
    await at(page, "test-pad").scrollIntoViewIfNeeded();
    const pad = (await at(page, "test-pad").boundingBox())!;
    const middle = { x: pad.x + pad.width / 2, y: pad.y + pad.height / 2 };
    await page.mouse.move(middle.x, middle.y);
    await page.mouse.down();
    for (const [x, y] of [[60, 0], [-60, 0], [0, 30], [0, -30]] as const) {
      await reach(page, x === 0 ? "mouse-up" : "mouse-right", () => page.mouse.move(middle.x + x, middle.y + y, { steps: 2 }), async () => undefined);
    }
    await page.mouse.up();
    for (const turn of [100, -100]) await reach(page, "mouse-deeper", () => page.mouse.wheel(0, turn), async () => undefined);
    await at(page, "use-device").click();
    await at(page, "fly").selectOption("tip:0");
    await page.waitForTimeout(300);
    const tip = (await inside(page, ({ drive }) => drive.mouse.tipOnScreen(0)))!;
    const box = (await at(page, "view").boundingBox())!;
    const eye = await inside(page, ({ world }) => world.camera.position.toArray());
    await page.mouse.move(box.x + tip.x, box.y + tip.y);
    await page.mouse.down();
    await page.mouse.move(box.x + tip.x + 60, box.y + tip.y, { steps: 4 });
    await eventually(() => Math.hypot(...(servo().at(-1)!["translation_m"] as number[])) > 0.003, "the drag is a motion");
    assert.equal(servo().at(-1)!["frame"], "world");
    const before = servo().at(-1)!["translation_m"] as number[];
    await page.mouse.wheel(0, -100);
    await eventually(() => Math.hypot(...(servo().at(-1)!["translation_m"] as number[]).map((v, k) => v - before[k]!)) > 0.0015, "the wheel inserts");
    await page.mouse.up();
    await eventually(() => server.cell.arms[0]!.actor === "hold", "hold");
    assert.deepEqual(await inside(page, ({ world }) => world.camera.position.toArray()), eye, "the view stays");
  });

  await t.test("a gamepad is tested, drives both arms, and rumbles with the force", async () => {
    await testGamepad(page);
    await says(page, "drive-note", /Ready/);
    const x = server.cell.arms[1]!.tip[0]!;
    await page.evaluate("window.fakePad.buttons[5] = 1; window.fakePad.axes[2] = 1");
    await eventually(() => server.cell.arms[1]!.tip[0]! > x + 0.01, "the right arm moves to the right");
    assert.notEqual(server.cell.arms[0]!.actor, "operator");
    await page.evaluate("window.fakePad.buttons[4] = 1");
    await eventually(() => server.cell.arms[0]!.actor === "operator", "both arms");
    await expectSoon(() => page.evaluate("window.fakePad.rumbles > 0"), true, "rumble");
    const jaw = server.cell.arms[1]!.jawTarget;
    assert.ok(jaw < 0.95, "a released trigger opens nothing before it met the jaw");
  });

  await t.test("a gamepad that is gone lets go, and is tested again", async () => {
    await unplug(page);
    await says(page, "drive-note", /gamepad is gone/);
    await eventually(() => server.cell.arms.every((arm) => arm.actor !== "operator"), "the arms hold");
    assert.equal(await at(page, "use-device").isDisabled(), true);
    await page.evaluate("window.fakePad.connected = true; window.fakePad.axes = [0, 0, 0, 0]; window.fakePad.buttons.fill(0)");
  });

  await t.test("sliders send an action until the arm is there", async () => {
    await at(page, "device").selectOption("sliders");
    await expectSoon(() => at(page, "slider-right-4").isEnabled(), true, "enabled");
    await at(page, "slider-right-4").fill("0.15");
    await eventually(() => Math.abs(server.cell.arms[1]!.jaw - 0.15) < 0.02, "the jaw closes");
    await eventually(() => server.of("servo_jp").length > 0 && server.cell.arms[1]!.actor === "hold", "then it holds");
    assert.equal((server.of("servo_jp")[0]!["positions"] as number[]).length, 5);
  });

  await t.test("without a device the arms are given back", async () => {
    await at(page, "device").selectOption("");
    await eventually(() => server.seats["left"] === null && server.seats["right"] === null, "free seats");
  });

  await t.test("wrote no errors", () => assert.deepEqual(errors, []));
});
