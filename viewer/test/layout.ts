/** The page at 1280 and 390 pixels, light and dark: nothing is cut off, nothing jumps, everything is named and readable. */

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Page } from "playwright-core";
import { at, findBrowser, launch } from "./browser.ts";
import { inside, onFake, turn } from "./harness.ts";

const skip = findBrowser() ? false : "no Chromium here; install it or name it in CHROMIUM";
const TABS = ["task", "show", "plots", "drive", "episodes"];
/** Texts that may end in dots where there is no room: they are names with the whole text in a title or elsewhere. */
const MAY_END_IN_DOTS = ".bar h1, .bar .sub, .plot header span";

/** What is wrong with the texts and controls that are seen now. */
function problems(page: Page): Promise<string[]> {
  return page.evaluate((mayEndInDots) => {
    const out: string[] = [];
    const width = document.documentElement.clientWidth;
    if (document.documentElement.scrollWidth > width) out.push(`the page is ${document.documentElement.scrollWidth} px wide`);
    const rgb = (text: string): number[] => (text.match(/[\d.]+/g) ?? []).map(Number);
    const light = ([r = 0, g = 0, b = 0]: number[]): number => {
      const [x = 0, y = 0, z = 0] = [r, g, b].map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * x + 0.7152 * y + 0.0722 * z;
    };
    const ground = (element: Element): number[] => {
      for (let at: Element | null = element; at; at = at.parentElement) {
        const color = rgb(getComputedStyle(at).backgroundColor);
        if ((color[3] ?? 1) > 0.8) return color;
      }
      return [255, 255, 255];
    };
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      const parent = node.parentElement;
      const text = node.textContent?.trim();
      if (!parent || !text || parent.closest("option, script, style, noscript, .visually-hidden") || !parent.checkVisibility()) continue;
      const range = document.createRange();
      range.selectNodeContents(node);
      const box = range.getBoundingClientRect();
      if (box.width === 0) continue;
      const inside = parent.closest("button, th, td, label, .chip, .tabs, .panel, .bar, .transport, .legend, .inset") ?? document.body;
      const frame = inside.getBoundingClientRect();
      const cut = box.left < frame.left - 1 || box.right > frame.right + 1 || box.right > width + 1;
      if (cut && !parent.matches(mayEndInDots)) out.push(`cut off: '${text}'`);
      const style = getComputedStyle(parent);
      const [a, b] = [light(rgb(style.color)), light(ground(parent))];
      const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
      const idle = parent.closest("button:disabled, :disabled");
      if (contrast < 4.5 && !idle) out.push(`contrast ${contrast.toFixed(1)}: '${text}'`);
    }
    const context = document.createElement("canvas").getContext("2d")!;
    for (const control of document.querySelectorAll<HTMLElement>("button, select, input")) {
      if (!control.checkVisibility()) continue;
      const labels = (control as HTMLInputElement).labels;
      const named = control.getAttribute("aria-label") ?? (labels && labels.length > 0 ? labels[0]!.textContent : control.textContent);
      if (!named?.trim()) out.push(`no name: ${control.outerHTML.slice(0, 80)}`);
      if (!(control instanceof HTMLSelectElement)) continue;
      context.font = getComputedStyle(control).font;
      const text = control.selectedOptions[0]?.textContent ?? "";
      const padding = Number.parseFloat(getComputedStyle(control).paddingLeft) + 18;
      if (context.measureText(text).width + padding > control.clientWidth) out.push(`cut off: the choice '${text}'`);
    }
    return out;
  }, MAY_END_IN_DOTS);
}

test("the page at both widths", { skip }, async (t) => {
  const { server, page, close } = await onFake(await launch(), { width: 1280, height: 760 });
  t.after(close);
  for (const [width, height] of [[1280, 760], [390, 800]] as const) {
    await page.setViewportSize({ width, height });
    await page.evaluate(`
      window.shifted = [];
      new PerformanceObserver((list) => {
        for (const entry of list.getEntries()) if (!entry.hadRecentInput) window.shifted.push([entry.value, ...entry.sources.map((s) => s.node?.className || s.node?.nodeName)]);
      }).observe({ type: "layout-shift" });`);
    // Texts do not change while the simulation rests, and software draws slowly.
    server.playing = false;
    for (const colorScheme of ["light", "dark"] as const) {
      await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
      await page.waitForTimeout(150);
      for (const tab of TABS) {
        await t.test(`${tab}, ${colorScheme}, ${width} pixels`, async () => {
          await at(page, `tab-${tab}`).click();
          if (tab === "show") for (const id of ["show-contact", "show-rcm", "show-held"]) await turn(page, id, true);
          for (const device of tab === "drive" ? ["gamepad", "keyboard", "mouse", "sliders", ""] : [null]) {
            if (device !== null) await at(page, "device").selectOption(device);
            await page.waitForTimeout(120);
            assert.deepEqual(await problems(page), [], device ?? tab);
          }
          if (tab === "show") for (const id of ["show-contact", "show-rcm", "show-held"]) await turn(page, id, false);
        });
      }
    }
    await t.test(`nothing jumps while the simulation runs, ${width} pixels`, async () => {
      await at(page, "tab-task").click();
      server.playing = true;
      await page.waitForTimeout(700);
      await page.evaluate("window.shifted.length = 0");
      await page.waitForTimeout(1500);
      assert.deepEqual(await page.evaluate("window.shifted"), []);
    });
    await t.test(`a notice covers neither the legend nor the small picture, ${width} pixels`, async () => {
      await at(page, "tab-show").click();
      await turn(page, "show-rcm", true);
      await inside(page, ({ session }) => session.emit("problem", "The arms could not be taken, because another operator has both of them now."));
      const boxes = await page.evaluate(() => [".toast", ".legend", ".inset", ".view-tools .button"].map((name) => {
        const { left, right, top, bottom } = document.querySelector(name)!.getBoundingClientRect();
        return { name, left, right, top, bottom };
      }));
      const [toast, ...others] = boxes;
      assert.ok(toast && toast.right - toast.left > 100, "it is shown");
      for (const other of others) {
        const apart = toast.right <= other.left || toast.left >= other.right || toast.bottom <= other.top || toast.top >= other.bottom;
        assert.ok(apart, `it covers ${other.name}`);
      }
      await turn(page, "show-rcm", false);
      await at(page, "tab-task").click();
    });
    await t.test(`the keyboard reaches the view, the tabs and the playback, ${width} pixels`, async () => {
      const reached = new Set<string>();
      await page.evaluate("document.activeElement?.blur?.()");
      for (let i = 0; i < 40; i += 1) {
        await page.keyboard.press("Tab");
        reached.add(await page.evaluate(() => document.activeElement?.getAttribute("data-test") ?? ""));
      }
      for (const id of ["view", "home", "fly", "picture", "camera", "ray-trace", "swap", "tab-task", "policy", "seed", "begin", "play", "step", "reset", "scrub", "speed"]) {
        assert.ok(reached.has(id), `${id} is not reached by Tab`);
      }
      await at(page, "tab-task").focus();
      await page.keyboard.press("ArrowRight");
      assert.equal(await at(page, "tab-show").getAttribute("aria-selected"), "true");
    });
  }
});
