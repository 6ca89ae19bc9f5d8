/** Saves pictures of the page: `node build/test/look.js ADDRESS|fake FOLDER [TAB]`. */

import { fileURLToPath } from "node:url";
import { at, launch, openPage, quit } from "./browser.ts";
import { FakeServer } from "./fake/server.ts";
import { tunnel } from "./tunnel.ts";

const [address = "fake", folder = ".", only = ""] = process.argv.slice(2);
const dist = fileURLToPath(new URL("../../dist", import.meta.url));
const fake = address === "fake" ? new FakeServer(dist) : null;
const real = fake ? null : await tunnel(address, dist);
const url = fake ? await fake.listen() : real!.address;
const browser = await launch();
const looks = [
  { name: "light-1280", width: 1280, height: 760, dark: false, tab: "task" },
  { name: "dark-1280", width: 1280, height: 760, dark: true, tab: "show" },
  { name: "light-390", width: 390, height: 800, dark: false, tab: "plots" },
  { name: "dark-390", width: 390, height: 800, dark: true, tab: "drive" },
];
for (const look of looks) {
  const { page, errors } = await openPage(browser, look);
  await page.goto(url);
  await page.waitForFunction(() => (window as never as { trocar?: { session: { framesReceived: number } } }).trocar?.session.framesReceived, undefined, { timeout: 60_000 });
  await at(page, `tab-${only || look.tab}`).click();
  if ((only || look.tab) === "show") for (const id of ["show-contact", "show-rcm", "show-held", "show-cameras"]) await at(page, id).check({ force: true });
  if ((only || look.tab) === "drive") await at(page, "device").selectOption("keyboard");
  await page.waitForTimeout(2500);
  await page.screenshot({ path: `${folder}/${look.name}.png` });
  if (errors.length > 0) console.log(look.name, errors);
  await page.context().close();
}
await quit();
fake?.close();
real?.close();
