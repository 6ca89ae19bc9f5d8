/** Starts the browser of the tests: Debian's Chromium, without a window, drawing in software. */

import { existsSync } from "node:fs";
import { after } from "node:test";
import { chromium, type Browser, type Page } from "playwright-core";

const PLACES = [process.env["CHROMIUM"], "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

/** Where the browser is; null where there is none. */
export function findBrowser(): string | null {
  return PLACES.find((path): path is string => path !== undefined && existsSync(path)) ?? null;
}

let running: Promise<Browser> | null = null;

/** The browser; the tests of one process share it. */
export function launch(): Promise<Browser> {
  return (running ??= begin());
}

/** Ends the browser. */
export async function quit(): Promise<void> {
  await (await running)?.close();
  running = null;
}

after(quit);

async function begin(): Promise<Browser> {
  const executablePath = findBrowser();
  if (!executablePath) throw new Error("no Chromium; install it or name it in CHROMIUM");
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-dev-shm-usage"];
  return chromium.launch({ executablePath, args });
}

export interface Look {
  width?: number;
  height?: number;
  dark?: boolean;
}

/** A page; what it writes to the console as errors is collected. */
export async function openPage(browser: Browser, look: Look = {}): Promise<{ page: Page; errors: string[] }> {
  const context = await browser.newContext({
    viewport: { width: look.width ?? 900, height: look.height ?? 560 },
    colorScheme: look.dark ? "dark" : "light",
    reducedMotion: "reduce",
    acceptDownloads: true,
  });
  const page = await context.newPage();
  page.setDefaultTimeout(15_000);
  const errors: string[] = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  return { page, errors };
}

/** An element by its `data-test`. */
export function at(page: Page, id: string) {
  return page.locator(`[data-test="${id}"]`);
}
