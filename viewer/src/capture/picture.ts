/** Saves what the view shows as a PNG. */

import type { World } from "../scene/world.ts";
import type { Session } from "../wire/session.ts";

/** Draws, and saves the drawing; its file name, or null where the browser gives none. */
export async function savePicture(world: World, session: Session): Promise<string | null> {
  world.drawNow();
  const blob = await new Promise<Blob | null>((done) => world.canvas.toBlob(done, "image/png"));
  if (!blob) return null;
  const scene = session.scene?.header.name ?? "trocar";
  const time = session.frame?.header.time_s ?? 0;
  const name = `${scene}-${time.toFixed(2)}s.png`;
  download(blob, name);
  return name;
}

/** Gives a file to the user. */
export function download(blob: Blob, name: string): void {
  const address = URL.createObjectURL(blob);
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
