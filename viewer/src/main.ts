/** Puts the page together. */

import "./style/theme.css";
import "./style/layout.css";
import "./style/controls.css";
import "./style/panels.css";
import * as THREE from "three";
import { Forces } from "./overlays/forces.ts";
import { Nodes } from "./overlays/nodes.ts";
import { Rcm } from "./overlays/rcm.ts";
import { Bodies } from "./scene/bodies.ts";
import { Cameras } from "./scene/cameras.ts";
import { Organs } from "./scene/organs.ts";
import { World } from "./scene/world.ts";
import { DrivePanel } from "./ui/drive-panel.ts";
import { Bar } from "./ui/bar.ts";
import { Cover } from "./ui/cover.ts";
import { el } from "./ui/dom.ts";
import { sentence } from "./ui/format.ts";
import { EpisodesPanel } from "./ui/episodes-panel.ts";
import { Inset } from "./ui/inset.ts";
import { listen } from "./ui/keys.ts";
import { PlotsPanel } from "./ui/plots-panel.ts";
import { ShowPanel } from "./ui/show-panel.ts";
import { Tabs } from "./ui/tabs.ts";
import { TaskPanel } from "./ui/task-panel.ts";
import { Toast } from "./ui/toast.ts";
import { Transport } from "./ui/transport.ts";
import { ViewTools } from "./ui/view-tools.ts";
import { Connection } from "./wire/connection.ts";
import { VERSION } from "./wire/messages.ts";
import { Session } from "./wire/session.ts";

/** From where the first view looks: in front of the table, to its right, above it. */
const HOME_FROM = new THREE.Vector3(0.5, -0.8, 0.85);
/** The first view shows the organs and this much round them (m): the instruments and the ports. */
const HOME_MARGIN_M = 0.05;

function start(): void {
  const token = new URLSearchParams(location.search).get("token");
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const connection = new Connection(`${scheme}://${location.host}/wire/${VERSION}?token=${encodeURIComponent(token ?? "")}`);
  const session = new Session(connection);
  const toast = new Toast();
  const say = (text: string, state?: "plain" | "bad"): void => toast.say(text, state);

  const view = el("main", { class: "view", "aria-label": "View" });
  const canvas = el("canvas", {
    tabindex: 0, "data-test": "view", role: "application",
    "aria-label": "The simulated cell. Arrow keys turn the view, plus and minus zoom, P plays, full stop steps.",
  });
  view.append(canvas);
  const app = el("div", { class: "app" });
  app.append(view);
  document.body.append(app);

  const world = new World(canvas);
  const organs = new Organs(world, session);
  const bodies = new Bodies(world, session);
  const cameras = new Cameras(world, session);
  const forces = new Forces(world, session);
  const nodes = new Nodes(world, session);
  const rcm = new Rcm(world, session);
  const inset = new Inset(world, cameras, session);
  const show = new ShowPanel(session, { organs, bodies, cameras, forces, nodes, rcm });
  const drive = new DrivePanel(session, world, say);
  const transport = new Transport(session);
  const tools = new ViewTools(world, organs, session, say);
  const tabs = new Tabs(
    [
      { id: "task", label: "Task", panel: new TaskPanel(session).root },
      { id: "show", label: "Show", panel: show.root },
      { id: "plots", label: "Plots", panel: new PlotsPanel(session).root },
      { id: "drive", label: "Drive", panel: drive.root },
      { id: "episodes", label: "Episodes", panel: new EpisodesPanel(session).root },
    ],
    (id) => drive.setShown(id === "drive"),
  );
  view.append(tools.root, inset.root, show.legend, new Cover(session, token !== null).root, toast.root);
  app.prepend(new Bar(session).root);
  app.append(el("aside", { class: "side", "aria-label": "Panels" }, tabs.list, tabs.panels), transport.root);
  listen(world, transport, () => drive.clutched);

  session.on("organs", () => {
    world.setHome(organs.bounds().expandByScalar(HOME_MARGIN_M), HOME_FROM);
  });
  session.on("problem", (problem) => say(sentence(problem), "bad"));
  session.on("error", (error) => say(sentence(error.message), "bad"));
  session.on("event", (event) => {
    if (event.text) say(sentence(event.text));
  });
  let noted: string | null = null;
  session.on("status", ({ note }) => {
    if (note && note !== noted) say(sentence(note));
    noted = note ?? null;
  });
  session.on("hello", (hello) => {
    if (hello.version !== VERSION) say(`The simulator speaks version ${hello.version} of the wire; this page needs ${VERSION}.`, "bad");
    const holder = hello.seats["controls"];
    if (session.watches) say("This page watches. The program that steps the environment has the controls.");
    else if (holder === null || holder === undefined) connection.send({ type: "seats", take: ["controls"], give: [] } as { type: string });
    else if (holder !== hello.client) say("Another page has the controls. This one watches.");
  });
  if (token !== null) connection.open();
  Object.assign(window, { trocar: { session, world, show, drive } });
}

start();
