/** Keys of the view while it has the focus and no clutch is held: camera and playback. */

import type { World } from "../scene/world.ts";
import type { Transport } from "./transport.ts";

const TURN_RAD = 0.09;
const ZOOM = 0.88;

/** Listens on the view's canvas. */
export function listen(world: World, transport: Transport, busy: () => boolean): void {
  world.canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || busy()) return;
    const act = {
      ArrowLeft: () => world.orbit(-TURN_RAD, 0),
      ArrowRight: () => world.orbit(TURN_RAD, 0),
      ArrowUp: () => world.orbit(0, TURN_RAD),
      ArrowDown: () => world.orbit(0, -TURN_RAD),
      Equal: () => world.zoom(ZOOM),
      NumpadAdd: () => world.zoom(ZOOM),
      Minus: () => world.zoom(1 / ZOOM),
      NumpadSubtract: () => world.zoom(1 / ZOOM),
      Home: () => world.showHome(),
      KeyP: () => transport.togglePlay(),
      Period: () => transport.stepOnce(),
    }[event.code];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
