/** The page's icons: outlines on a grid of 16. */

const PATHS = {
  play: "M5 3.2v9.6l7.6-4.8z",
  pause: "M4.5 3h2.4v10H4.5zM9.1 3h2.4v10H9.1z",
  step: "M3.5 3.2v9.6L10 8zM11 3h2v10h-2z",
  reset: "M8 3a5 5 0 1 0 4.9 6h-1.6A3.5 3.5 0 1 1 8 4.5c1 0 1.8.4 2.4 1L8.7 7.2H13V2.9l-1.5 1.5A5 5 0 0 0 8 3z",
  picture: "M2 4.5h3l1-1.5h4l1 1.5h3v8H2zm6 1.7a2.4 2.4 0 1 0 0 4.8 2.4 2.4 0 0 0 0-4.8z",
  film: "M2 4h8.5v8H2zM11.3 7l3-2v6l-3-2z",
  stop: "M4 4h8v8H4z",
  home: "M8 2.2 2 7.4h1.6V13h3.3V9.6h2.2V13h3.3V7.4H14z",
  expand: "M2.5 2.5h4.6V4H4v3.1H2.5zM8.9 12H12V8.9h1.5v4.6H8.9z",
  ray: "M8 1.5l1.2 4 4-1.7-2.5 3.5 3.8 1.7-4.1.6.9 4.1L8 10.6l-3.3 3.1.9-4.1-4.1-.6 3.8-1.7L2.8 3.8l4 1.7z",
} as const;

export type Icon = keyof typeof PATHS;

/** An icon as SVG; screen readers pass it over. */
export function icon(name: Icon): SVGSVGElement {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", PATHS[name]);
  path.setAttribute("fill", "currentColor");
  path.setAttribute("fill-rule", "evenodd");
  svg.append(path);
  return svg;
}
