import { defineConfig } from "vite";

export default defineConfig({
  // Relative addresses: the page works in any folder of any host, and from `splitsnow serve`.
  base: "./",
  server: { fs: { allow: [".."] } },
  build: { target: "es2022", modulePreload: { polyfill: false }, assetsInlineLimit: 0 },
  worker: { format: "es" },
  test: { include: ["tests/**/*.test.ts"], testTimeout: 240_000, hookTimeout: 120_000, fileParallelism: false },
} as Parameters<typeof defineConfig>[0]);
