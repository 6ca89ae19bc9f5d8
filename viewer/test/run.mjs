/** Builds the page, then runs its tests one file after another: `npm test`. */

import { spawnSync } from "node:child_process";
import { fileURLToPath } from "node:url";

const folder = fileURLToPath(new URL("..", import.meta.url));
const run = (command, ...args) => {
  const { status } = spawnSync(command, args, { cwd: folder, stdio: "inherit" });
  if (status !== 0) process.exit(status ?? 1);
};
run("npm", "run", "--silent", "build");
run("npx", "--no-install", "tsc", "-p", "test");
const files = ["unit", "page", "drive", "layout", "real"].map((name) => `build/test/${name}.test.js`);
run(process.execPath, "--test", "--test-concurrency=1", "--test-reporter=spec", ...files);
