import { defineConfig } from "vitest/config";

export default defineConfig(({ command }) => ({
  // Relative addresses: the page works in any folder of any host, and from `splitsnow serve`.
  base: "./",
  server: { fs: { allow: [".."] } },
  // `vite dev` serves the engine from here; `site.mjs` puts it beside the built page.
  publicDir: command === "serve" ? "build" : false,
  build: {
    target: "es2022",
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
    // The same names for every version: `dist` is part of the repository.
    rollupOptions: {
      output: {
        entryFileNames: "assets/page.js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
      },
    },
  },
  worker: { format: "es" },
  test: { include: process.env.SPLITSNOW ? ["tests/program.spec.ts"] : ["tests/**/*.test.ts"], testTimeout: 240_000, hookTimeout: 120_000, fileParallelism: false },
}));
