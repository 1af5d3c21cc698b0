// Builds the page into src/bowden/console/static/: node build.mjs [--out FOLDER]. `make console` calls it.
// The head of the bundle names a hash of all sources; tests/test_console_bundle.py computes it again without Node.
import { createHash } from "node:crypto";
import { copyFileSync, mkdirSync, readdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { dirname, join, relative, sep } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const at = process.argv.indexOf("--out");
const out = at > 0 ? process.argv[at + 1] : join(here, "..", "src", "bowden", "console", "static");
const MOST_BYTES = 150_000;

function files(folder) {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) =>
    entry.isDirectory() ? files(join(folder, entry.name)) : [join(folder, entry.name)],
  );
}

const loose = ["build.mjs", "package.json", "package-lock.json", "tsconfig.json"].map((name) => join(here, name));
const sources = [...files(join(here, "src")), ...files(join(here, "static")), ...loose]
  .map((path) => relative(here, path).split(sep).join("/"))
  .sort();
const hash = createHash("sha256");
for (const name of sources) {
  hash.update(`${name}\0`);
  hash.update(readFileSync(join(here, name)));
  hash.update("\0");
}
const head = `/* bowden console; made by make console from web/, sources sha256:${hash.digest("hex")} */`;

mkdirSync(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { console: "src/main.ts" },
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "eof",
  banner: { js: head, css: head },
  outdir: out,
  logLevel: "warning",
});
for (const name of ["index.html", "favicon.svg"]) copyFileSync(join(here, "static", name), join(out, name));
const licence = readFileSync(join(here, "node_modules", "uplot", "LICENSE"), "utf8").trim();
writeFileSync(join(out, "third-party.txt"), `console.js and console.css contain uPlot:\n\n${licence}\n`);
const size = statSync(join(out, "console.js")).size;
console.log(`console.js: ${size} bytes`);
if (size > MOST_BYTES) {
  console.error(`console.js has ${size} bytes; ${MOST_BYTES} are the most`);
  process.exit(1);
}
