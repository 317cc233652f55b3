// How soon a browser shows something of sites of 3D Tiles: `tessera view` serves each, headless Chromium opens it with a profile of
// its own. A line of JSON a site: seconds and CPU seconds from the address to the first picture, and what was asked for by then.
// On a busy machine seconds say little; CPU seconds are those of all processes of the browser and of the server.
//   usage: node first_picture.js TESSERA SITE... [--rounds N] [--shots FOLDER]
import { spawn } from "node:child_process";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { loadavg } from "node:os";
import { basename, join } from "node:path";
import { Browser, chromiumPath } from "./chromium.js";

const words = process.argv.slice(2), option = (name, none) => {
  const at = words.indexOf(name);
  return at < 0 ? none : words.splice(at, 2)[1];
};
const rounds = Number(option("--rounds", 1)), shots = option("--shots", null);
const [binary, ...sites] = words;
if (sites.length === 0 || !(rounds >= 1)) {
  console.error("usage: node first_picture.js TESSERA SITE... [--rounds N] [--shots FOLDER]");
  process.exit(2);
}
if (!chromiumPath()) {
  console.error("first_picture: no chromium: apt install chromium, or name it in CHROMIUM");
  process.exit(2);
}

const TICK = 100;  // of the clock in /proc, a second

/** CPU seconds so far of a process and all below it, by kind: renderer, gpu-process, utility, zygote, or the rest. */
function cpuSeconds(root) {
  const parents = new Map(), seconds = new Map();
  for (const name of readdirSync("/proc")) {
    if (!/^\d+$/.test(name)) continue;
    try {
      const stat = readFileSync(`/proc/${name}/stat`, "latin1"), fields = stat.slice(stat.lastIndexOf(")") + 2).split(" ");
      parents.set(Number(name), Number(fields[1]));
      seconds.set(Number(name), fields.slice(11, 15).reduce((sum, ticks) => sum + Number(ticks), 0) / TICK);  // ended children too
    } catch { /* it ended meanwhile */ }
  }
  const below = (pid) => {
    for (; pid > 1; pid = parents.get(pid) ?? 0) if (pid === root) return true;
    return false;
  };
  const sums = {};
  for (const [pid, s] of seconds) {
    if (!below(pid)) continue;
    let kind = "browser";
    try {
      kind = /--type=([a-z-]+)/.exec(readFileSync(`/proc/${pid}/cmdline`, "latin1"))?.[1] ?? kind;
    } catch { /* it ended meanwhile */ }
    sums[kind] = (sums[kind] ?? 0) + s;
  }
  return sums;
}
const total = (sums) => Object.values(sums).reduce((a, b) => a + b, 0);
const rounded = (x) => Math.round(100 * x) / 100;

async function measure(site) {
  const server = spawn(binary, ["view", site], { stdio: ["ignore", "pipe", "ignore"] });
  const url = await new Promise((done, fail) => {
    server.stdout.once("data", (text) => done(String(text).trim()));
    server.once("exit", (code) => fail(new Error(`tessera view ended with ${code}`)));
  });
  const browser = new Browser();
  try {
    const page = await browser.open("about:blank");
    await new Promise((done) => setTimeout(done, 500));  // what Chromium does of its own accord when it starts
    await page.send("Performance.enable", { timeDomain: "threadTicks" });
    const before = cpuSeconds(browser.child.pid), served = total(cpuSeconds(server.pid)), load = loadavg()[0], start = Date.now();
    await page.send("Page.navigate", { url });
    await page.until("window.tessera && tessera.times.picture !== null", 120);
    const after = cpuSeconds(browser.child.pid), wall = (Date.now() - start) / 1000;
    const metrics = Object.fromEntries((await page.send("Performance.getMetrics")).metrics.map((m) => [m.name, m.value]));
    const { times, state, asked } = await page.evaluate(`({ times: tessera.times, state: tessera.state(),
      asked: [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
        .filter((r) => r.startTime < tessera.times.picture).map((r) => r.transferSize) })`);
    if (shots) writeFileSync(join(shots, `${basename(site)}.png`), await page.screenshot());
    const by = {};
    for (const kind of Object.keys(after)) by[kind] = rounded(after[kind] - (before[kind] ?? 0));
    return {
      site: basename(site), picture_s: rounded(times.picture / 1000), seen_s: rounded(wall), cpu_s: rounded(total(after) - total(before)), by,
      main_thread_s: rounded(metrics.TaskDuration), server_s: rounded(total(cpuSeconds(server.pid)) - served), load: rounded(load),
      requests: asked.length, bytes: asked.reduce((sum, bytes) => sum + bytes, 0), triangles: state.triangles, trouble: state.trouble,
    };
  } finally {
    await browser.close();
    server.kill("SIGTERM");
  }
}

for (const site of sites)
  for (let round = 0; round < rounds; ++round) console.log(JSON.stringify(await measure(site)));
