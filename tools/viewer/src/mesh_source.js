// A mesh that the page itself holds (`tessera view mesh.ply`), in runs of faces: those out of sight are not drawn, and a
// ray looks at few. Faces come in the order of the file, in which neighbours are close to each other.
import { Box3, BufferAttribute, BufferGeometry, Group, Mesh, Sphere, Vector3 } from "three";
import { base64Bytes, inflate, splitByMark, undoDifferences } from "./blocks.js";
import { materialFor } from "./material.js";

const RUN = 1 << 15;  // faces
const SAMPLE = 1 << 14;  // points, to fit the picture to

async function block(id, Kind) {
  const element = document.getElementById(id);
  if (!element) return null;
  const bytes = await inflate(base64Bytes(element.textContent));
  element.remove();
  return new Kind(bytes.buffer, 0, bytes.byteLength / Kind.BYTES_PER_ELEMENT);
}

function widened(values, source, width) {
  const old = values.length / width, all = new values.constructor(values.length + source.length * width);
  all.set(values);
  source.forEach((from, i) => {
    for (let k = 0; k < width; ++k) all[(old + i) * width + k] = values[from * width + k];
  });
  return all;
}

/** \returns {object, box, sample, colours}: content in the mesh's coordinates less config.origin; some points of it */
export async function loadMesh() {
  let [position, index, colour, marks, deviation, uncertain] = await Promise.all([
    block("mesh-positions", Float32Array), block("mesh-faces", Int32Array), block("mesh-colours", Uint8Array),
    block("mesh-synthetic", Uint8Array), block("mesh-deviation", Float32Array),
    block("mesh-uncertain", Uint8Array)]);
  // Without indices every three positions are a face.
  index = index ? new Uint32Array(undoDifferences(index).buffer) : Uint32Array.from({ length: position.length / 3 }, (_, i) => i);
  let synthetic = null;
  if (marks) {
    const split = splitByMark(index, marks, position.length / 3);
    position = widened(position, split.source, 3);
    if (colour) colour = widened(colour, split.source, 3);
    if (deviation) deviation = widened(deviation, split.source, 1);
    if (uncertain) uncertain = widened(uncertain, split.source, 1);
    synthetic = split.mark;
  }
  const attributes = { position: new BufferAttribute(position, 3) };
  if (colour) attributes.color = new BufferAttribute(colour, 3, true);
  if (synthetic) attributes.synthetic = new BufferAttribute(synthetic, 1);
  if (deviation) attributes.deviation = new BufferAttribute(deviation, 1);
  if (uncertain) attributes.uncertain = new BufferAttribute(uncertain, 1);
  const faces = new BufferAttribute(index, 1);

  const object = new Group(), box = new Box3();
  for (let first = 0; first < index.length; first += 3 * RUN) {
    const geometry = new BufferGeometry();
    for (const [name, attribute] of Object.entries(attributes)) geometry.setAttribute(name, attribute);
    geometry.setIndex(faces);
    const end = Math.min(index.length, first + 3 * RUN);
    geometry.setDrawRange(first, end - first);
    geometry.boundingBox = boxOf(position, index, first, end);
    geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new Sphere());
    box.union(geometry.boundingBox);
    object.add(new Mesh(geometry, materialFor(geometry)));
  }
  const colours = [...(colour ? ["rgb"] : []), ...(deviation ? ["deviation"] : []), ...(synthetic ? ["synthetic"] : []),
                   ...(uncertain ? ["uncertain"] : [])];
  const sample = [], step = Math.max(1, Math.floor(index.length / SAMPLE));
  for (let i = 0; i < index.length; i += step) sample.push(new Vector3().fromArray(position, 3 * index[i]));
  return { object, box, sample, colours };
}

function boxOf(position, index, first, end) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = first; i < end; ++i)
    for (let k = 0, at = 3 * index[i]; k < 3; ++k) {
      const c = position[at + k];
      if (c < low[k]) low[k] = c;
      if (c > high[k]) high[k] = c;
    }
  return new Box3(new Vector3(...low), new Vector3(...high));
}
