/** Runs the fake server for looking at the page: `node build/test/serve-fake.js`. */

import { fileURLToPath } from "node:url";
import { FakeServer } from "./fake/server.ts";

console.log(await new FakeServer(fileURLToPath(new URL("../../dist", import.meta.url))).listen());
