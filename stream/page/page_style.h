/// \file page_style.h
/// How a page looks: in light and dark, on paper, narrow and wide.
#pragma once

namespace tessera {

inline constexpr const char* kPageStyle = R"css(
:root { --fg: #1c2126; --bg: #fbfbfa; --soft: #5b6670; --line: #d5dade; --bar: #3a76b0; --good: #23703a; --bad: #a92a1c; --warn: #8a5a00; --box: #f0f2f3; }
@media (prefers-color-scheme: dark) {
  :root { --fg: #e4e8eb; --bg: #15181b; --soft: #a3adb5; --line: #3a4147; --bar: #6ba4d8; --good: #6cc987; --bad: #ff8e80; --warn: #e3b04d; --box: #20252a; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 62rem; padding: 1.5rem; background: var(--bg); color: var(--fg); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.7rem; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem; }
header p, .note, figcaption { color: var(--soft); margin: .3rem 0; }
code, bdi { overflow-wrap: anywhere; }
.state { font-size: 1rem; font-weight: 600; border: 2px solid; border-radius: .4rem; padding: .05rem .5rem; vertical-align: middle; }
.good { color: var(--good); } .bad, .refused { color: var(--bad); }
.refused { font-size: 1.1rem; border-left: .3rem solid; padding-left: .8rem; overflow-wrap: anywhere; }
.warn li { color: var(--warn); overflow-wrap: anywhere; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.tile { background: var(--box); border-radius: .5rem; padding: .7rem .9rem; }
.tile b { display: block; font-size: 1.25rem; font-variant-numeric: tabular-nums; } .tile span { color: var(--soft); font-size: .9rem; }
table { border-collapse: collapse; width: 100%; margin: .6rem 0 1rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { text-align: left; font-weight: normal; padding: .2rem .8rem .2rem 0; vertical-align: top; border-bottom: 1px solid var(--line); }
th[scope=row] { color: var(--soft); width: 19rem; } td { overflow-wrap: anywhere; }
.wide { font-size: .85rem; } .wide th[scope=row] { width: auto; }
.bars td.n { width: 9rem; text-align: right; } .bars td.bar { width: 45%; }
.bars td.bar span { display: block; height: .8rem; margin-top: .35rem; min-width: 1px; background: var(--bar); border-radius: .15rem; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
figure { margin: 1rem 0; } figure.histogram { max-width: 44rem; } figure.histogram > figcaption { color: var(--fg); font-weight: 600; }
img { display: block; max-width: 100%; height: auto; border: 1px solid var(--line); border-radius: .4rem; background: #fff; }
svg { display: block; width: 100%; height: auto; } svg rect { fill: var(--bar); } svg text { fill: var(--soft); font-size: 13px; }
svg line { stroke: var(--soft); } svg .mark { stroke: var(--bad); } svg text.mark { stroke: none; fill: var(--bad); font-weight: 600; }
.verdict { border: .2rem solid; border-radius: .5rem; padding: .6rem 1rem; margin: 1.2rem 0; }
.verdict b { display: block; font-size: 2.4rem; line-height: 1.2; letter-spacing: .05em; } .verdict span { color: var(--fg); }
.scale { max-width: 36rem; } .scale > figcaption { color: var(--fg); font-weight: 600; } svg rect, .key span { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.key { margin: .1rem 0; font-size: .9rem; } .key span { display: inline-block; width: 1.2rem; height: .8rem; border: 1px solid var(--line); }
.drawing > figcaption { color: var(--fg); } svg.plan { max-width: 100%; } svg.plan path { fill: none; stroke: var(--fg); stroke-width: 5; stroke-linejoin: round; stroke-linecap: round; }
svg.plan .grid path { stroke: var(--line); stroke-width: 2; } svg.plan text { font-size: 54px; } svg.plan .name { fill: var(--fg); font-size: 60px; }
svg.plan .area { fill: var(--bar); fill-opacity: .25; stroke: var(--bar); stroke-width: 7; } svg.plan .axis { stroke: var(--bar); stroke-width: 7; } svg.plan .mark { stroke: var(--bad); stroke-width: 4; }
svg.plan .label { fill: var(--fg); font-size: 54px; font-weight: 600; paint-order: stroke; stroke: var(--bg); stroke-width: 12px; }
.sign { display: none; }
summary { cursor: pointer; color: var(--soft); }
.stage { border: 1px solid var(--line); border-radius: .4rem; overflow: hidden; background: var(--box); }
canvas { display: block; width: 100%; aspect-ratio: 4 / 3; touch-action: none; cursor: grab; }
canvas:focus-visible, button:focus-visible { outline: 3px solid var(--bar); outline-offset: 2px; }
button { font: inherit; padding: .2rem .8rem; }
@media (max-width: 40rem) { th[scope=row] { width: 40%; } .bars td.bar { width: 30%; } body { padding: 1rem; } }
@page { size: A4; margin: 15mm; }
@media print {
  :root { --fg: #000; --bg: #fff; --soft: #333; --line: #bbb; --bar: #3a76b0; --good: #000; --bad: #000; --warn: #000; --box: #fff; }
  body { max-width: none; padding: 0; font-size: 11pt; } section { break-inside: auto; } figure, tr, .tile { break-inside: avoid; }
  .drawing, .scale, .verdict { break-inside: avoid; } thead { display: table-header-group; }
  .sign { display: flex; gap: 2cm; margin-top: 2.2cm; break-inside: avoid; } .sign span { flex: 1; border-top: 1px solid #000; padding-top: .1cm; font-size: 9pt; }
  .tiles { grid-template-columns: repeat(auto-fit, minmax(3cm, 1fr)); } .tile { border: 1px solid var(--line); } #preview, summary { display: none; } h2 { break-after: avoid; }
}
)css";

}  // namespace tessera
