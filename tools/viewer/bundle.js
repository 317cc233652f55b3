// Puts script and style into the page: bundle.js FOLDER writes FOLDER/viewer.html and the server beside it.
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, renameSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const here = new URL(".", import.meta.url).pathname, folder = process.argv[2];
const options = { bundle: true, minify: true, write: false, target: ["es2022"], legalComments: "none", logLevel: "warning" };
const script = await build({ ...options, entryPoints: [join(here, "src/main.js")], format: "iife", metafile: true });
const style = await build({ ...options, entryPoints: [join(here, "src/viewer.css")] });
const packages = new Set(Object.keys(script.metafile.inputs)
  .map((path) => /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(path)?.[1]).filter(Boolean));
const licences = [...packages].sort().map((name) => {
  const root = join(here, "node_modules", name), about = JSON.parse(readFileSync(join(root, "package.json"), "utf8"));
  const file = readdirSync(root).find((f) => /^licen[cs]e/i.test(f));
  return `${name} ${about.version} (${about.license})\n\n${readFileSync(join(root, file), "utf8")}`;
}).join("\n" + "-".repeat(80) + "\n\n");
// What the page is made of asks to be named wherever a copy of it goes.
if (/<\/script/i.test(licences)) throw new Error("a licence would end its block");

const parts = { "/*tessera:style*/": style.outputFiles[0].text, "/*tessera:script*/": script.outputFiles[0].text,
                "/*tessera:licences*/": licences };
let page = readFileSync(join(here, "src/viewer.html"), "utf8");
for (const [mark, text] of Object.entries(parts)) page = page.replace(mark, () => text);
if (page.split("<!--tessera:data-->").length !== 2) throw new Error("the page has not one place for its data");
mkdirSync(folder, { recursive: true });
copyFileSync(join(here, "serve.py"), join(folder, "serve.py"));
writeFileSync(join(folder, "viewer.html.part"), page);
renameSync(join(folder, "viewer.html.part"), join(folder, "viewer.html"));
