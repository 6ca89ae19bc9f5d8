import { defineConfig } from "vite";

// The page is served by the program from its root, under a token: every path in it is relative.
export default defineConfig({
  base: "./",
  build: { target: "es2022", outDir: "dist", assetsInlineLimit: 0, chunkSizeWarningLimit: 1500, sourcemap: false },
});
