// Small sites as files: a hilly ground of two levels, packed as large ones are (16 bits a coordinate, meshopt), with a
// red mark at a known place.
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { MeshoptEncoder } from "meshoptimizer";

export const SIZE = 40, MARK = [12.5, -7.25];
export const height = (x, y) => 3 * Math.sin(x / 6) * Math.cos(y / 5) + 0.05 * x;

/** A channel of sRGB, 0 to 255, as glTF stores it in 16 bits: linear. */
const linear = (c) => Math.round(65535 * (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));

/** Ground of cells over a square of the plane, corners as a scan has them: z up. */
export function ground(low, high, cells) {
  const positions = [], colours = [], synthetic = [], faces = [];
  for (let j = 0; j <= cells; ++j)
    for (let i = 0; i <= cells; ++i) {
      const x = low[0] + (high[0] - low[0]) * i / cells, y = low[1] + (high[1] - low[1]) * j / cells;
      positions.push([x, y, height(x, y)]);
      const marked = Math.hypot(x - MARK[0], y - MARK[1]) < 1.2;
      colours.push(marked ? [255, 0, 0, 255] : [90 + 4 * (height(x, y) + 5), 140, 90, 255]);
      synthetic.push(Math.hypot(x + 10, y + 10) < 4 ? 1 : 0);
    }
  for (let j = 0; j < cells; ++j)
    for (let i = 0; i < cells; ++i) {
      const a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1, d = c + 1;
      faces.push([a, b, d], [a, d, c]);
    }
  return { positions, colours, synthetic, faces };
}

export function ply({ positions, colours, synthetic, faces }, shift = [0, 0, 0]) {
  const lines = ["ply", "format ascii 1.0", `element vertex ${positions.length}`, "property double x", "property double y",
                 "property double z", "property uchar red", "property uchar green", "property uchar blue",
                 `element face ${faces.length}`, "property list uchar int vertex_indices", "property uchar synthetic", "end_header"];
  positions.forEach((p, i) => lines.push([...p.map((c, k) => c + shift[k]), ...colours[i].slice(0, 3).map(Math.round)].join(" ")));
  faces.forEach((f) => lines.push(`3 ${f.join(" ")} ${f.some((v) => synthetic[v]) ? 1 : 0}`));
  return lines.join("\n") + "\n";
}

function glb({ positions, colours, synthetic, faces }, low, size) {
  const n = positions.length, step = size / 65535;
  const place = new Uint16Array(4 * n), tint = new Uint16Array(4 * n), mark = new Uint8Array(4 * n);
  positions.forEach(([x, y, z], i) => {  // y up in glTF
    place.set([(x - low[0]) / step, (z - low[2]) / step, (low[1] + size - y) / step].map(Math.round), 4 * i);
    tint.set([...colours[i].slice(0, 3).map(linear), 65535], 4 * i);
    mark[4 * i] = synthetic[i];
  });
  const index = new Uint32Array(faces.flat());
  const encode = (array, count, stride, mode) => MeshoptEncoder.encodeGltfBuffer(new Uint8Array(array.buffer), count, stride, mode);
  const streams = [[place, n, 8, "ATTRIBUTES"], [tint, n, 8, "ATTRIBUTES"], [mark, n, 4, "ATTRIBUTES"],
                   [index, index.length, 4, "TRIANGLES"]];
  const views = [], packed = [];
  let at = 0, unpacked = 0;
  for (const [array, count, byteStride, mode] of streams) {
    const bytes = encode(array, count, byteStride, mode);
    views.push({ buffer: 1, byteOffset: unpacked, byteLength: count * byteStride, ...(mode === "ATTRIBUTES" ? { byteStride } : {}),
                 extensions: { EXT_meshopt_compression: { buffer: 0, byteOffset: at, byteLength: bytes.length, byteStride, count, mode } } });
    packed.push(bytes, new Uint8Array(-bytes.length & 3));
    at += bytes.length + (-bytes.length & 3);
    unpacked += count * byteStride;
  }
  const range = (k) => positions.map((_, i) => place[4 * i + k]);
  const accessor = (bufferView, componentType, type, more = {}) => ({ bufferView, componentType, count: n, type, ...more });
  const json = {
    asset: { version: "2.0" }, extensionsUsed: ["KHR_mesh_quantization", "EXT_meshopt_compression"],
    extensionsRequired: ["KHR_mesh_quantization", "EXT_meshopt_compression"],
    scene: 0, scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, scale: [step, step, step], translation: [low[0], low[2], -(low[1] + size)] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, COLOR_0: 1, _SYNTHETIC: 2 }, indices: 3 }] }],
    accessors: [accessor(0, 5123, "VEC3", { min: [0, 1, 2].map((k) => Math.min(...range(k))), max: [0, 1, 2].map((k) => Math.max(...range(k))) }),
                accessor(1, 5123, "VEC4", { normalized: true }), accessor(2, 5121, "SCALAR"),
                { bufferView: 3, componentType: 5125, count: index.length, type: "SCALAR" }],
    bufferViews: views,
    buffers: [{ byteLength: at }, { byteLength: unpacked, extensions: { EXT_meshopt_compression: { fallback: true } } }],
  };
  let text = JSON.stringify(json);
  text += " ".repeat(-Buffer.byteLength(text) & 3);
  const body = Buffer.concat(packed), head = Buffer.alloc(20), mid = Buffer.alloc(8);
  head.write("glTF");
  [2, 28 + text.length + body.length, text.length, 0x4e4f534a].forEach((v, i) => head.writeUInt32LE(v, 4 + 4 * i));
  mid.writeUInt32LE(body.length, 0), mid.writeUInt32LE(0x004e4942, 4);
  return Buffer.concat([head, Buffer.from(text), mid, body]);
}

/** Root and four quarters. \param transform  of the root: 16 numbers, or none */
export async function writeSite(folder, { transform, extras, cells = 24 } = {}) {
  await MeshoptEncoder.ready;
  mkdirSync(join(folder, "tiles"), { recursive: true });
  const tile = (name, low, high, n, geometricError, children) => {
    const part = ground(low, high, n), z = part.positions.map((p) => p[2]);
    const box = [Math.min(...z), Math.max(...z)], size = high[0] - low[0], middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    writeFileSync(join(folder, "tiles", name), glb(part, [low[0], low[1], box[0]], size));
    return { boundingVolume: { box: [...middle, (box[0] + box[1]) / 2, size / 2, 0, 0, 0, size / 2, 0, 0, 0, (box[1] - box[0]) / 2] },
             geometricError, content: { uri: `tiles/${name}` }, ...(children ? { children } : {}) };
  };
  const half = SIZE / 2, children = [];
  for (const [i, j] of [[0, 0], [1, 0], [0, 1], [1, 1]])
    children.push(tile(`1-${i}${j}.glb`, [i * half - half, j * half - half], [i * half, j * half], 2 * cells, 0));
  const root = { refine: "REPLACE", ...tile("0.glb", [-half, -half], [half, half], cells / 2, 0.8, children) };
  if (transform) root.transform = transform;
  writeFileSync(join(folder, "tileset.json"),
    JSON.stringify({ asset: { version: "1.1", ...(extras ? { extras: { tessera: extras } } : {}) }, geometricError: 4, root }));
}
