/** The page in a browser, on the fake server: that it comes up, moves, and that each control and overlay does what it says. */

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { readFile } from "node:fs/promises";
import type { Browser, Page } from "playwright-core";
import { at, findBrowser, launch } from "./browser.ts";
import type { FakeServer } from "./fake/server.ts";
import { eventually, expectSoon, inside, onFake, says, turn, until } from "./harness.ts";

const skip = findBrowser() ? false : "no Chromium here; install it or name it in CHROMIUM";

/** Colours in the view: how many differ, coarsely. */
async function colours(page: Page): Promise<number> {
  return inside(page, ({ world }) => {
    world.drawNow();
    const copy = document.createElement("canvas");
    copy.width = 96;
    copy.height = 64;
    const context = copy.getContext("2d")!;
    context.drawImage(world.canvas, 0, 0, 96, 64);
    const { data } = context.getImageData(0, 0, 96, 64);
    const seen = new Set<number>();
    for (let i = 0; i < data.length; i += 4) seen.add((data[i]! >> 4) * 256 + (data[i + 1]! >> 4) * 16 + (data[i + 2]! >> 4));
    return seen.size;
  });
}

test("the page", { skip }, async (t) => {
  let browser: Browser;
  let page: Page;
  let server: FakeServer;
  let errors: string[];
  let close: () => Promise<void>;
  before(async () => {
    browser = await launch();
    ({ server, page, errors, close } = await onFake(browser));
  });
  after(() => close());

  await t.test("comes up: names the scene, is connected, draws", async () => {
    await says(page, "scene-name", /^cell-a$/);
    await says(page, "chip-link", /^Connected$/);
    assert.equal(await page.locator(".cover").isHidden(), true);
    assert.ok((await colours(page)) > 40, "the view has more than a background");
  });

  await t.test("organs move in the data and in the picture", async () => {
    const place = () => inside(page, ({ session }) => session.organs[0]!.positions.slice(600, 603).join());
    const first = await place();
    const pictures = await inside(page, ({ world }) => world.pictures);
    await expectSoon(async () => (await place()) !== first, true, "the organ has moved");
    await until(page, ({ session }) => session.organs[0]!.version > 8, "eight motions");
    await expectSoon(async () => (await inside(page, ({ world }) => world.pictures)) > pictures + 1, true, "pictures are drawn");
  });

  await t.test("plays, pauses, steps, begins again with a seed and a policy", async () => {
    await at(page, "play").click();
    await eventually(() => !server.playing, "pause");
    await says(page, "rate", /^Paused$/);
    const before = server.cell.step;
    await at(page, "step").click();
    await eventually(() => server.cell.step === before + 1, "one period");
    await at(page, "seed").fill("7");
    await at(page, "policy").selectOption("noise");
    await at(page, "begin").click();
    await eventually(() => server.seed === 7 && server.policy === "noise" && server.cell.step === 0, "reset");
    await says(page, "chip-actors", /noise/);
    await at(page, "play").click();
    await eventually(() => server.playing, "play");
    await at(page, "reset").click();
    await eventually(() => server.of("reset").length === 2, "reset");
    assert.equal(server.of("reset")[1]!["seed"], undefined, "the same seed");
  });

  await t.test("sets the speed and shows the measured one", async () => {
    await at(page, "speed").selectOption("4");
    await eventually(() => server.speed === 4, "speed");
    await says(page, "rate", /^4\.00x$/);
    await at(page, "speed").selectOption("1");
    await eventually(() => server.speed === 1, "speed");
  });

  await t.test("scrubs", async () => {
    await at(page, "play").click();
    await eventually(() => !server.playing, "pause");
    await at(page, "scrub").fill("2");
    await eventually(() => server.cell.step === 60, "seek");
    await says(page, "time", /^2\.00 s$/);
    await at(page, "play").click();
  });

  await t.test("shows stages with their thresholds, and readings of both arms", async () => {
    await says(page, "gates", /grasped and lift_mm >= 8 mm for 0.5 s/);
    await says(page, "constraint-force-left", /^0\.40 N$/);
    await says(page, "follow-ratio-left", /^0\.95$/);
    await says(page, "follow-ratio-right", /^–$/);
    await says(page, "holds-left", /^Appendix$/);
    await says(page, "rcm-deviation-left", /^0\.40 mm$/);
  });

  await t.test("each overlay is a switch", async () => {
    await at(page, "tab-show").click();
    const drawn = () => inside(page, ({ show }) => show.drawn as Record<string, number>);
    const cases: [id: string, what: string, count: number][] = [
      ["show-contact", "contacts", 2], ["show-contact", "arrows", 2], ["show-constraint", "constraints", 1], ["show-held", "held", 3], ["show-pins", "pins", 40],
    ];
    for (const [id, what, count] of cases) {
      assert.equal((await drawn())[what], 0, `${what} before`);
      await turn(page, id, true);
      await expectSoon(async () => (await drawn())[what], count, what);
      await turn(page, id, false);
      await expectSoon(async () => (await drawn())[what], 0, `${what} off`);
    }
    const last = server.of("subscribe").at(-1)!;
    assert.deepEqual([last["contacts"], last["held"]], [false, false], "what is not shown is not sent");
  });

  await t.test("RCM rings show where the shaft crosses the port, as far as the simulator says", async () => {
    await turn(page, "show-rcm", true);
    await says(page, "legend", /3 mm.*5 mm/);
    const crossing = async () => (await inside(page, ({ show }) => show.drawn["crossings"] as number[]))[0] ?? 0;
    await expectSoon(async () => Math.abs((await crossing()) - 0.4) < 0.05, true, "the left shaft crosses 0.4 mm from the centre");
    await turn(page, "show-rcm", false);
  });

  await t.test("colours tissue by stretch and by energy, and back", async () => {
    const colour = () => inside(page, ({ world }) => {
      const scene = (world as unknown as { scene: { getObjectByName(name: string): { geometry: { attributes: { color: { array: Float32Array } } } } } }).scene;
      return scene.getObjectByName("appendix").geometry.attributes.color.array.slice(300, 303).join();
    });
    const own = await colour();
    await at(page, "value").selectOption("stretch");
    await says(page, "legend", /Stretch.*1\.00.*1\.50/);
    await page.waitForTimeout(300);
    assert.notEqual(await colour(), own);
    await at(page, "value").selectOption("energy");
    await says(page, "legend", /Energy.*0.*900 J\/m3/);
    await at(page, "value").selectOption("");
    await page.waitForTimeout(300);
    assert.equal(await colour(), own);
    assert.equal(await at(page, "legend").isHidden(), true);
  });

  await t.test("see-through, cameras and what is hidden change the picture", async () => {
    const picture = () => inside(page, ({ world }) => {
      world.drawNow();
      const copy = document.createElement("canvas");
      copy.width = 64;
      copy.height = 48;
      copy.getContext("2d")!.drawImage(world.canvas, 0, 0, 64, 48);
      return copy.toDataURL();
    });
    await at(page, "play").click();
    await eventually(() => !server.playing, "pause");
    await page.waitForTimeout(200);
    for (const id of ["transparent", "show-cameras", "hide-instruments"]) {
      const first = await picture();
      await turn(page, id, true);
      assert.notEqual(await picture(), first, id);
      await turn(page, id, false);
      assert.equal(await picture(), first, `${id}, off again`);
    }
    await at(page, "play").click();
  });

  await t.test("orbits by mouse and keys, pans, flies to an organ and home", async () => {
    const eye = () => inside(page, ({ world }) => world.camera.position.toArray());
    const target = () => inside(page, ({ world }) => world.controls.target.toArray());
    const [eye0, target0] = [await eye(), await target()];
    await at(page, "view").hover({ position: { x: 260, y: 120 } });
    await page.mouse.down();
    await page.mouse.move(340, 200, { steps: 3 });
    await page.mouse.up();
    assert.notDeepEqual(await eye(), eye0, "orbit");
    assert.deepEqual(await target(), target0);
    await page.mouse.move(420, 140);
    await page.mouse.down({ button: "right" });
    await page.mouse.move(380, 180, { steps: 4 });
    await page.mouse.up({ button: "right" });
    await expectSoon(async () => (await target()).join() !== target0.join(), true, "pan");
    await at(page, "fly").selectOption("organ:cecum");
    await page.waitForTimeout(100);
    const [x = 0, y = 0] = await target();
    assert.ok(Math.abs(x + 0.035) < 0.01 && Math.abs(y - 0.475) < 0.01, `looks at ${x} ${y}`);
    await at(page, "home").click();
    await page.waitForTimeout(100);
    assert.ok(Math.hypot(...(await target()).map((v, k) => v - target0[k]!)) < 1e-3);
    await at(page, "view").focus();
    const before = await eye();
    await page.keyboard.press("ArrowLeft");
    assert.notDeepEqual(await eye(), before, "arrow keys");
  });

  await t.test("the small canvas shows the endoscope, its ray-traced picture, and can be the large view", async () => {
    const lit = () => page.evaluate(() => {
      const canvas = document.querySelector<HTMLCanvasElement>('[data-test="endoscope"]')!;
      const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i]! > 80) count += 1;
      return count / (data.length / 4);
    });
    assert.ok((await lit()) > 0.05, "tissue is lit");
    await at(page, "ray-trace").click();
    await says(page, "camera-caption", /^Ray traced at \d+\.\d\d s$/);
    assert.equal(await at(page, "traced").evaluate((img: HTMLImageElement) => img.decode().then(() => img.naturalWidth)), 2);
    assert.equal(server.of("picture")[0]!["camera"], "endoscope");
    await at(page, "ray-trace").click();
    assert.equal(await at(page, "traced").isHidden(), true);
    await at(page, "swap").click();
    assert.equal(await inside(page, ({ world }) => world.through !== null), true);
    await at(page, "swap").click();
    // The picture of a lens that distorts is bent; the large view through it is straight and says so.
    await at(page, "camera").selectOption("d405");
    assert.equal(await at(page, "camera-caption").isHidden(), true);
    assert.ok((await lit()) > 0.01, "a bent picture is lit");
    await at(page, "swap").click();
    await says(page, "camera-caption", /lacks the lens's distortion/);
    await at(page, "swap").click();
    await at(page, "camera").selectOption("endoscope");
  });

  await t.test("plots any channel from the episode's begin on", async () => {
    await at(page, "tab-plots").click();
    await at(page, "channel").selectOption("right_rcm_mm");
    await says(page, "plot-right_rcm_mm", /Right RCM\d\.\d+ mm/);
    const drawn = await at(page, "plot-right_rcm_mm").locator("canvas").evaluate((canvas: HTMLCanvasElement) => {
      const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
      return data.some((v, i) => i % 4 === 3 && v > 200);
    });
    assert.equal(drawn, true);
    await at(page, "plot-right_rcm_mm").getByRole("button").click();
    assert.equal(await at(page, "plot-right_rcm_mm").count(), 0);
  });

  await t.test("lists a campaign with failures first, opens an episode, goes back", async () => {
    await at(page, "tab-episodes").click();
    const rows = at(page, "episodes").locator("tr");
    assert.match((await rows.first().textContent()) ?? "", /Time out/);
    assert.match((await rows.last().textContent()) ?? "", /Passed/);
    await rows.first().getByRole("button").click();
    await says(page, "mode", /Review/);
    assert.equal(server.open, "scripted/000003");
    await at(page, "live").click();
    await says(page, "mode", /Live/);
  });

  await t.test("saves a picture and a film", async () => {
    const [picture] = await Promise.all([page.waitForEvent("download"), at(page, "picture").click()]);
    assert.match(picture.suggestedFilename(), /^cell-a-\d+\.\d\ds\.png$/);
    const png = await readFile((await picture.path())!);
    assert.equal(png.subarray(1, 4).toString(), "PNG");
    assert.ok(png.length > 5000, `${png.length} bytes`);
    await at(page, "film").click();
    await page.waitForTimeout(1200);
    const [film] = await Promise.all([page.waitForEvent("download"), at(page, "film").click()]);
    assert.match(film.suggestedFilename(), /^cell-a\.(webm|mp4)$/);
    assert.ok((await readFile((await film.path())!)).length > 2000);
  });

  await t.test("a cut brings new organs without leaking the old ones", async () => {
    const memory = () => inside(page, ({ world }) => world.renderer.info.memory.geometries);
    const first = await memory();
    for (let i = 0; i < 3; i += 1) {
      server.cut();
      await page.waitForTimeout(200);
    }
    await until(page, ({ session }) => session.organs.length === 2 && session.organs[0]!.version > 0, "frames after the cut");
    await page.waitForTimeout(200);
    assert.equal(await memory(), first);
  });

  await t.test("connects again after a loss", async () => {
    server.drop();
    await says(page, "chip-link", /lost|Connecting/);
    await says(page, "chip-link", /^Connected$/);
    await until(page, ({ session }) => session.status !== null, "status");
    await eventually(() => server.seats["controls"] !== null, "the controls are taken again");
  });

  await t.test("a second page watches and says that it does not control", async () => {
    const holder = server.seats["controls"];
    server.seats["controls"] = 999;
    server.drop();
    await says(page, "toast", /Another page has the controls/);
    await expectSoon(() => at(page, "play").isDisabled(), true, "play is disabled");
    server.seats["controls"] = null;
    assert.notEqual(holder, 999);
  });

  await t.test("an environment is watched: nothing is taken, nothing can be driven", async () => {
    server.kind = "environment";
    server.drop();
    await says(page, "toast", /steps the environment has the controls/);
    await says(page, "chip-actors", /Stepped by its own program/);
    await at(page, "tab-drive").click();
    assert.match((await page.locator("#panel-drive").textContent()) ?? "", /This page watches/);
    assert.equal(await at(page, "play").isDisabled(), true);
    assert.deepEqual(server.seats, { controls: null, left: null, right: null });
    const frames = await inside(page, ({ session }) => session.framesReceived);
    await expectSoon(async () => (await inside(page, ({ session }) => session.framesReceived)) > frames, true, "frames come");
  });

  await t.test("wrote no errors", () => {
    const unexpected = errors.filter((text) => !/WebSocket connection|GPU stall|ERR_CONNECTION/.test(text));
    assert.deepEqual(unexpected, []);
  });
});
