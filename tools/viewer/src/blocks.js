// The data blocks of a page that holds its mesh: base64 of zlib's deflate of little-endian numbers. Pure.

export function base64Bytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; ++i) out[i] = raw.charCodeAt(i);
  return out;
}

export async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers were stored as differences to the one before, in wrapping 32 bits: undone in place. */
export function undoDifferences(words) {
  let last = 0;
  for (let i = 0; i < words.length; ++i) {
    last = (last + words[i]) | 0;
    words[i] = last;
  }
  return words;
}

/**
 * Faces carry a mark, shaders see vertices: a vertex of marked and of other faces becomes two. Indices are changed in
 * place. \returns {source, mark}: the old number of every new vertex beyond `vertices`, and the mark of all
 */
export function splitByMark(index, faceMark, vertices) {
  const mark = new Uint8Array(vertices), plain = new Uint8Array(vertices);
  for (let f = 0; f < faceMark.length; ++f)
    for (let k = 3 * f; k < 3 * f + 3; ++k)
      if (faceMark[f]) mark[index[k]] = 1;
      else plain[index[k]] = 1;
  const source = [], copy = new Map();
  for (let f = 0; f < faceMark.length; ++f) {
    if (!faceMark[f]) continue;
    for (let k = 3 * f; k < 3 * f + 3; ++k) {
      const v = index[k];
      if (!plain[v]) continue;
      if (!copy.has(v)) {
        copy.set(v, vertices + source.length);
        source.push(v);
      }
      index[k] = copy.get(v);
    }
  }
  const all = new Uint8Array(vertices + source.length);
  for (let v = 0; v < vertices; ++v) all[v] = mark[v] && !plain[v] ? 1 : 0;
  all.fill(1, vertices);
  return { source, mark: all };
}
