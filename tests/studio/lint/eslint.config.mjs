// SPDX-License-Identifier: MIT
// ESLint for the studio's page (make lint-page): its recommended rules, and what tells a slip from an intention.

import js from "@eslint/js";

// What the page takes from the browser. A whole browser's list would let pass `name`, `event` or `status` by mistake.
const BROWSER = [
  "addEventListener", "Blob", "clearInterval", "clearTimeout", "devicePixelRatio", "document", "Element", "Event",
  "fetch", "getComputedStyle", "innerWidth", "localStorage", "location", "matchMedia", "navigator", "Option",
  "performance", "requestAnimationFrame", "ResizeObserver", "setInterval", "setTimeout", "URL", "URLSearchParams",
  "WebSocket", "window",
];

export default [
  js.configs.recommended,
  {
    linterOptions: { reportUnusedDisableDirectives: "error" },
    languageOptions: {
      ecmaVersion: 2024,
      sourceType: "module",
      globals: Object.fromEntries(BROWSER.map((name) => [name, "readonly"])),
    },
    rules: {
      "eqeqeq": ["error", "always", { null: "ignore" }],
      "no-shadow": "error",
      "no-var": "error",
      "prefer-const": "error",
      "max-len": ["error", { code: 120 }],
      "max-lines": ["error", 499],
    },
  },
];
