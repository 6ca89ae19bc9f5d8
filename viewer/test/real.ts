/** The page on a real `trocar view`, where TROCAR names the program: what a fake cannot vouch for. */

import assert from "node:assert/strict";
import { spawn, spawnSync, type ChildProcess } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { at, findBrowser, launch, openPage } from "./browser.ts";
import { FAKE_GAMEPAD } from "./fake/gamepad.ts";
import { DIST, expectSoon, inside, says, testGamepad, testKeyboard, turn, until } from "./harness.ts";
import { tunnel } from "./tunnel.ts";

const TROCAR = process.env["TROCAR"];
const skip = !TROCAR ? "TROCAR names no program" : findBrowser() ? false : "no Chromium here; install it or name it in CHROMIUM";

/** Starts the program; its address. */
async function start(child: ChildProcess): Promise<string> {
  const lines = createInterface({ input: child.stdout! });
  for await (const line of lines) return String((JSON.parse(line) as { address: string }).address);
  throw new Error("trocar view ended without an address");
}

test("on a simulator", { skip }, async (t) => {
  const folder = mkdtempSync(join(tmpdir(), "trocar-page-"));
  const args = ["view", "cell-a", "--port", "0", "--no-open", "--json", "--threads", "1", "--seed", "1", "--record", join(folder, "demonstrations")];
  let browser: Browser;
  let page: Page;
  let errors: string[];
  let child: ChildProcess;
  let closeTunnel: () => void;
  before(async () => {
    child = spawn(TROCAR!, args, { stdio: ["ignore", "pipe", "inherit"] });
    const through = await tunnel(await start(child), DIST);
    closeTunnel = through.close;
    browser = await launch();
    ({ page, errors } = await openPage(browser, { width: 760, height: 460 }));
    await page.addInitScript(FAKE_GAMEPAD);
    await page.goto(through.address, { timeout: 60_000 });
    for (let i = 0; i < 5; i += 1) {
      if (await inside(page, (trocar) => Boolean(trocar?.session.framesReceived))) break;
      await until(page, (trocar) => trocar.session.framesReceived > 0, "frames").catch(() => undefined);
    }
  });
  after(async () => {
    await page.context().close();
    closeTunnel();
    child.kill("SIGTERM");
    rmSync(folder, { recursive: true, force: true });
  });

  await t.test("six organs come up and move", async () => {
    await says(page, "scene-name", /^cell-a$/);
    assert.equal(await inside(page, ({ session }) => session.organs.length), 6);
    await until(page, ({ session }) => session.organs.some((organ) => organ.version > 5), "motion");
    await says(page, "gates", /lift_mm >= 8 mm for 0\.5 s/);
  });

  await t.test("steps while paused and goes back to a time that was", async () => {
    await at(page, "play").click();
    await says(page, "rate", /^Paused$/);
    const time = () => inside(page, ({ session }) => session.status!.time_s);
    const before = await time();
    await at(page, "step").click();
    await expectSoon(async () => (await time()) > before, true, "one step");
    await at(page, "scrub").fill("0.5");
    await says(page, "time", /^0\.50 s$/);
  });

  await t.test("overlays have the simulator's data", async () => {
    await at(page, "tab-show").click();
    for (const [id, what] of [["show-pins", "pins"], ["show-contact", "contacts"]] as const) {
      await turn(page, id, true);
      await expectSoon(async () => Number((await inside(page, ({ show }) => show.drawn))[what]) > 0, true, what);
      await turn(page, id, false);
    }
    await turn(page, "show-rcm", true);
    const crossing = () => inside(page, ({ show }) => (show.drawn["crossings"] as number[])[0] ?? 99);
    const told = await inside(page, ({ session }) => session.arm(0, "rcm_mm"));
    await expectSoon(async () => Math.abs((await crossing()) - told) < 0.05, true, `${told} mm of deviation as drawn`);
    await turn(page, "show-rcm", false);
    await at(page, "value").selectOption("stretch");
    await says(page, "legend", /Stretch/);
    await at(page, "value").selectOption("");
  });

  await t.test("the ray-traced picture of the endoscope", async () => {
    await at(page, "ray-trace").click();
    await expectSoon(() => at(page, "traced").isVisible(), true, "the picture", 40_000);
    assert.equal(await at(page, "traced").evaluate((img: HTMLImageElement) => img.decode().then(() => img.naturalWidth)), 640);
    await at(page, "ray-trace").click();
  });

  await t.test("keys drive the left arm to a target", async () => {
    await at(page, "tab-task").click();
    await at(page, "policy").selectOption("operator");
    await at(page, "begin").click();
    await says(page, "chip-actors", /operator/i);
    await testKeyboard(page);
    await at(page, "frame").selectOption("world");
    if ((await page.locator('[data-test="rate"]').textContent()) === "Paused") await at(page, "play").click();
    await expectSoon(async () => /x$/.test((await at(page, "rate").textContent()) ?? ""), true, "playing");
    const x = () => inside(page, ({ session }) => session.armVector(0, "tip_x_m", 1)[0]!);
    const begin = await x();
    await at(page, "view").focus();
    await page.keyboard.down("Space");
    await page.keyboard.down("a");
    await expectSoon(async () => (await x()) < begin - 0.01, true, "the tip is 10 mm to the left");
    await page.keyboard.up("a");
    await page.keyboard.up("Space");
    await says(page, "drive-note", /holds its place/);
    const latency = await inside(page, ({ session }) => session.latencyMs);
    t.diagnostic(`from a command to the frame that shows it: ${latency?.toFixed(0)} ms, on this machine as it was`);
  });

  await t.test("a gamepad drives the right arm to a target", async () => {
    await testGamepad(page);
    const x = () => inside(page, ({ session }) => session.armVector(1, "tip_x_m", 1)[0]!);
    const begin = await x();
    await page.evaluate("window.fakePad.buttons[5] = 1; window.fakePad.axes[2] = 1");
    await expectSoon(async () => (await x()) > begin + 0.01, true, "the tip is 10 mm to the right");
    await page.evaluate("window.fakePad.axes[2] = 0; window.fakePad.buttons[5] = 0");
    await says(page, "drive-note", /holds its place/);
  });

  await t.test("the demonstration is kept, and replays to the bit", async () => {
    await at(page, "keep").click();
    await says(page, "record-note", /Kept as/);
    const found = episodes(join(folder, "demonstrations"));
    assert.equal(found.length, 1, `episodes: ${found.join()}`);
    const replay = spawnSync(TROCAR!, ["replay", found[0]!, "--verify"], { encoding: "utf8" });
    assert.equal(replay.status, 0, replay.stdout + replay.stderr);
  });

  await t.test("wrote no errors", () => assert.deepEqual(errors, []));
});

/** Episode files below a folder. */
function episodes(folder: string): string[] {
  return readdirSync(folder).flatMap((name) => {
    const path = join(folder, name);
    if (statSync(path).isDirectory()) return episodes(path);
    return name === "episode.trocar" ? [path] : [];
  });
}
