/** Makes the pictures of the docs: `node build/test/pictures.js ADDRESS|fake FOLDER [TIME_S]`, with the address of a running `trocar view`. */

import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { at, launch, openPage, quit } from "./browser.ts";
import { FakeServer } from "./fake/server.ts";
import { expectSoon, inside, turn } from "./harness.ts";
import { tunnel } from "./tunnel.ts";

const [address = "fake", folder = ".", time = ""] = process.argv.slice(2);
const dist = fileURLToPath(new URL("../../dist", import.meta.url));
const fake = address === "fake" ? new FakeServer(dist) : null;
const real = fake ? null : await tunnel(address, dist);
const url = fake ? await fake.listen() : real!.address;

const LOOKS: { name: string; width: number; height: number; dark: boolean; prepare: (page: Page) => Promise<unknown> }[] = [
  { name: "live-view-light", width: 1280, height: 760, dark: false, prepare: (page) => at(page, "tab-task").click() },
  {
    name: "live-view-dark", width: 1280, height: 760, dark: true, prepare: async (page) => {
      await at(page, "tab-show").click();
      await at(page, "value").selectOption("stretch");
      for (const id of ["show-contact", "show-constraint", "show-held"]) await turn(page, id, true);
      await at(page, "fly").selectOption("tip:0");
    },
  },
  { name: "live-view-light-390", width: 390, height: 780, dark: false, prepare: (page) => at(page, "tab-plots").click() },
  {
    name: "live-view-dark-390", width: 390, height: 780, dark: true, prepare: async (page) => {
      await at(page, "tab-drive").click();
      await at(page, "device").selectOption("keyboard");
      await at(page, "drive-note").click();
      for (const key of ["d", "a", "w"]) {
        await page.keyboard.down(key);
        await page.waitForTimeout(300);
        if (key !== "w") await page.keyboard.up(key);
      }
    },
  },
];

for (const { name, width, height, dark, prepare } of LOOKS) {
  const { page, errors } = await openPage(await launch(), { width, height, dark });
  await page.goto(url, { timeout: 60_000 });
  await expectSoon(() => inside(page, (trocar) => Boolean(trocar?.session.framesReceived)), true, "frames", 90_000);
  if (time) {
    await expectSoon(async () => (await inside(page, ({ session }) => session.status!.time_s)) > 0 && !(await at(page, "scrub").isDisabled()), true, "the episode", 90_000);
    await at(page, "scrub").fill(time);
    await expectSoon(async () => Math.abs((await inside(page, ({ session }) => session.status!.time_s)) - Number(time)) < 0.05, true, "the time", 60_000);
  }
  await prepare(page);
  await page.waitForTimeout(4000);
  await page.screenshot({ path: `${folder}/${name}.jpg`, type: "jpeg", quality: 82, timeout: 60_000 });
  if (errors.length > 0) console.log(name, errors);
  await page.context().close();
}
await quit();
fake?.close();
real?.close();
