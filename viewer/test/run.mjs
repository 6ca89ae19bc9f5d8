/** Runs the page's tests: `npm run test:unit` in seconds, `npm run test:browser`, `npm test` for both. */

import { spawnSync } from "node:child_process";
import { fileURLToPath } from "node:url";

const folder = fileURLToPath(new URL("..", import.meta.url));
const which = process.argv[2] ?? "all";
const run = (command, ...args) => {
  const { status } = spawnSync(command, args, { cwd: folder, stdio: "inherit" });
  if (status !== 0) process.exit(status ?? 1);
};
if (which !== "unit") run("npm", "run", "--silent", "build");
run("npx", "--no-install", "tsc", "-p", "test");
const files = { unit: ["unit"], browser: ["browser"], all: ["unit", "browser"] }[which];
run(process.execPath, "--test", "--test-concurrency=1", "--test-reporter=spec", ...files.map((name) => `build/test/${name}.test.js`));
