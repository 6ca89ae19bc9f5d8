/** What the browser tests share: a page on the fake server, and looks into the page's state. */

import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { at, openPage, type Look } from "./browser.ts";
import { press, stick } from "./fake/gamepad.ts";
import { FakeServer } from "./fake/server.ts";

export const DIST = fileURLToPath(new URL("../../dist", import.meta.url));

/** The page's own objects, as `window.trocar` has them. */
export interface Inside {
  session: {
    framesReceived: number;
    latencyMs: number | null;
    organs: { name: string; positions: Float32Array; version: number }[];
    has(seat: string): boolean;
    emit(kind: "problem", text: string): void;
    arm(arm: number, column: string): number;
    armVector(arm: number, column: string, count: number): number[];
    status: { time_s: number; actors: Record<string, string> } | null;
    table: { episodes: unknown[] } | null;
  };
  world: {
    pictures: number;
    through: unknown;
    camera: { position: { toArray(): number[] } };
    controls: { target: { toArray(): number[] } };
    renderer: { info: { memory: { geometries: number; textures: number } } };
    drawNow(): void;
    canvas: HTMLCanvasElement;
  };
  show: { drawn: Record<string, unknown> };
  drive: { operator: { clutched: boolean }; mouse: { tipOnScreen(arm: number): { x: number; y: number } | null } };
}

/** Evaluates a function of the page's objects in the page. */
export function inside<T>(page: Page, look: (trocar: Inside) => T): Promise<T> {
  return page.evaluate(`(${look.toString()})(window.trocar)`) as Promise<T>;
}

/** Waits until a function of the page's objects is true; the page's policy forbids what playwright's own wait does. */
export async function until(page: Page, look: (trocar: Inside) => unknown, what: string, limitMs = 20_000): Promise<void> {
  const end = Date.now() + limitMs;
  while (!(await page.evaluate(`Boolean(window.trocar && (${look.toString()})(window.trocar))`))) {
    if (Date.now() > end) throw new Error(`not in time: ${what}`);
    await page.waitForTimeout(40);
  }
}

/** Waits until something is true here. */
export async function eventually(look: () => unknown, what: string, limitMs = 10_000): Promise<void> {
  const end = Date.now() + limitMs;
  while (!look()) {
    if (Date.now() > end) throw new Error(`not in time: ${what}`);
    await new Promise((done) => setTimeout(done, 20));
  }
}

/** Waits until a look gives a value. */
export async function expectSoon<T>(look: () => Promise<T>, value: T, what: string, limitMs = 10_000): Promise<void> {
  const end = Date.now() + limitMs;
  for (;;) {
    const now = await look();
    if (now === value) return;
    if (Date.now() > end) throw new Error(`${what} is ${String(now)}; it must be ${String(value)}`);
    await new Promise((done) => setTimeout(done, 40));
  }
}

/** Waits until an element's text matches. */
export async function says(page: Page, id: string, text: RegExp): Promise<void> {
  const element = at(page, id);
  const end = Date.now() + 10_000;
  let last = "";
  while (Date.now() < end) {
    last = (await element.textContent()) ?? "";
    if (text.test(last)) return;
    await page.waitForTimeout(40);
  }
  throw new Error(`'${id}' says '${last}'; it must match ${text}`);
}

/** A page on a new fake server, with its first picture drawn. */
export async function onFake(browser: Browser, look: Look = {}, before?: (page: Page) => Promise<unknown>) {
  const server = new FakeServer(DIST);
  const { page, errors } = await openPage(browser, { width: 760, height: 460, ...look });
  const close = async (): Promise<void> => {
    await page.context().close();
    server.close();
  };
  try {
    await before?.(page);
    await page.goto(await server.listen(), { timeout: 60_000 });
    await until(page, (trocar) => trocar.session.framesReceived > 1 && trocar.world.pictures > 0, "the first picture", 60_000);
  } catch (error) {
    await close();
    throw error;
  }
  return { server, page, errors, close };
}

/** Turns a switch of the page, whose own box is hidden behind its drawing. */
export async function turn(page: Page, id: string, on: boolean): Promise<void> {
  await at(page, id).setChecked(on, { force: true });
}

/** How many ends of an axis of the axis test were reached. */
export async function ends(page: Page, axis: string): Promise<number> {
  const text = (await page.locator(`[data-axis="${axis}"] output`).textContent()) ?? "";
  return text === "Tested" ? 2 : Number(text[0]);
}

/** Does something until one more end of an axis is reached. */
export async function reach(page: Page, axis: string, move: () => Promise<void>, rest: () => Promise<void>): Promise<void> {
  const before = await ends(page, axis);
  await move();
  await expectSoon(async () => (await ends(page, axis)) > before, true, `another end of ${axis}`);
  await rest();
}

/** Moves every axis of the keyboard both ways and takes it for driving. */
export async function testKeyboard(page: Page): Promise<void> {
  await at(page, "tab-drive").click();
  await at(page, "device").selectOption("keyboard");
  await at(page, "drive-note").click();
  const keys = { right: "da", up: "ws", deeper: "eq", roll: "lj", jaw: "ik" };
  for (const [axis, both] of Object.entries(keys)) {
    for (const key of both) {
      await reach(page, `keyboard-0-${axis}`, () => page.keyboard.down(key), () => page.keyboard.up(key));
    }
  }
  await at(page, "use-device").click();
}

/** Moves every axis of the fake gamepad both ways and takes it for driving. */
export async function testGamepad(page: Page): Promise<void> {
  await at(page, "tab-drive").click();
  await at(page, "device").selectOption("gamepad");
  for (const arm of [0, 1]) {
      const axis = (name: string) => `gamepad-${arm}-${name}`;
      for (const [name, index] of [["right", 2 * arm], ["up", 2 * arm + 1]] as const) {
        for (const value of [1, -1]) await reach(page, axis(name), () => stick(page, index, value), () => stick(page, index, 0));
      }
      const [deeper, back, right, left, trigger] = arm === 0 ? [12, 13, 15, 14, 6] : [3, 0, 1, 2, 7];
      for (const button of [deeper!, back!]) await reach(page, axis("deeper"), () => press(page, button, 1), () => press(page, button, 0));
      for (const button of [right!, left!]) await reach(page, axis("roll"), () => press(page, button, 1), () => press(page, button, 0));
      // A released trigger is the one end of the jaw.
      await reach(page, axis("jaw"), () => press(page, trigger!, 1), () => press(page, trigger!, 0));
    }
  await expectSoon(() => at(page, "use-device").isEnabled(), true, "the test is done");
  await at(page, "use-device").click();
}
