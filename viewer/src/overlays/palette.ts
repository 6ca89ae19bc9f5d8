/** The overlays' colours, from the page's style sheet, so that drawing and legend agree. */

import * as THREE from "three";

export type Tint = "left" | "right" | "contact" | "constraint" | "good" | "warn" | "bad" | "soft" | "accent";

const known = new Map<Tint, THREE.Color>();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => known.clear());

/** A colour of the theme as three uses it. */
export function tint(name: Tint, into = new THREE.Color()): THREE.Color {
  let color = known.get(name);
  if (!color) {
    const text = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    known.set(name, (color = new THREE.Color(text || "#888888")));
  }
  return into.copy(color);
}

/** The colour of an arm: left first. */
export function armTint(arm: number): Tint {
  return arm === 0 ? "left" : "right";
}
