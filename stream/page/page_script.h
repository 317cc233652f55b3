/// \file page_script.h
/// Turns the preview of a page by mouse, finger or key: WebGL 2, nothing loaded. Faces are lit by the normal of what is on
/// screen, so that the page holds positions alone; backs are orange as in the pictures.
#pragma once

namespace tessera {

inline constexpr const char* kPreviewScript = R"js(
"use strict";
(() => {
  const canvas = document.getElementById("view"), note = document.getElementById("view-note");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return;

  const bytes = (id) => {
    const block = document.getElementById(id);
    if (!block) return null;
    const text = atob(block.textContent), out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) out[i] = text.charCodeAt(i);
    return out;
  };
  const positions = new Uint16Array(bytes("view-positions").buffer);
  const faces = new Uint32Array(bytes("view-faces").buffer);
  const colours = bytes("view-colours");
  const size = document.getElementById("view-box").dataset.size.split(",").map(Number);

  const compile = (kind, text) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, `#version 300 es
    in vec3 position; in vec3 colour;
    uniform mat3 turn; uniform vec3 centre; uniform vec2 shift; uniform vec2 scale; uniform float lift;
    out vec3 at; out vec3 tint;
    void main() {
      at = turn * (position - centre);
      tint = colour;
      gl_Position = vec4((at.xy + shift) * scale, -0.5 * at.z - lift, 1.0);
    }`));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float;
    in vec3 at; in vec3 tint;
    uniform bool line; uniform vec3 edge;
    out vec4 pixel;
    void main() {
      vec3 n = normalize(cross(dFdx(at), dFdy(at)));
      vec3 base = gl_FrontFacing ? tint : vec3(0.94, 0.55, 0.18);
      float light = 0.25 + 0.55 * max(0.0, dot(n, normalize(vec3(-0.4, 0.6, 0.8)))) + 0.25 * max(0.0, n.z);
      pixel = vec4(line ? edge : base * min(light, 1.05), 1.0);
    }`));
  gl.linkProgram(program);
  gl.useProgram(program);
  const at = (name) => gl.getUniformLocation(program, name);
  const uniforms = {};
  for (const name of ["turn", "centre", "shift", "scale", "lift", "line", "edge"]) uniforms[name] = at(name);

  const attribute = (name, data, kind) => {
    const place = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, kind, true, 0, 0);
  };
  // Three words a vertex are six bytes: drivers want multiples of four, so they are taken apart into four.
  const padded = new Uint16Array(positions.length / 3 * 4);
  for (let i = 0, j = 0; i < positions.length; i += 3, j += 4) padded.set(positions.subarray(i, i + 3), j);
  const place = gl.getAttribLocation(program, "position");
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, padded, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, 3, gl.UNSIGNED_SHORT, true, 8, 0);
  if (colours) attribute("colour", colours, gl.UNSIGNED_BYTE);
  else gl.vertexAttrib3f(gl.getAttribLocation(program, "colour"), 0.84, 0.82, 0.78);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
  let edges = null, wire = false;  // made when first asked for

  const home = () => ({ turn: 0.6, tilt: -1.0, zoom: 1, x: 0, y: 0 });
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let view = home(), asked = false;
  const draw = () => {
    asked = false;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    canvas.width = Math.max(1, canvas.clientWidth * ratio);
    canvas.height = Math.max(1, canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...(dark.matches ? [0.125, 0.145, 0.165, 1] : [0.94, 0.95, 0.95, 1]));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    // z is up: turned about it, then tilted towards the viewer. Columns of the matrix.
    const a = Math.cos(view.turn), b = Math.sin(view.turn), c = Math.cos(view.tilt), d = Math.sin(view.tilt);
    gl.uniformMatrix3fv(uniforms.turn, false, [a, b * c, b * d, -b, a * c, a * d, 0, -d, c]);
    gl.uniform3f(uniforms.centre, size[0] / 2, size[1] / 2, size[2] / 2);
    const reach = Math.hypot(...size) / 2 / view.zoom, aspect = canvas.width / canvas.height;
    gl.uniform2f(uniforms.shift, view.x, view.y);
    gl.uniform2f(uniforms.scale, 1 / reach / Math.max(aspect, 1), 1 / reach * Math.min(aspect, 1));
    gl.uniform1f(uniforms.lift, 0);
    gl.uniform1i(uniforms.line, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.faces);
    gl.drawElements(gl.TRIANGLES, faces.length, gl.UNSIGNED_INT, 0);
    if (!wire) return;
    gl.uniform1f(uniforms.lift, 0.0005);
    gl.uniform1i(uniforms.line, 1);
    gl.uniform3f(uniforms.edge, 0.2, 0.22, 0.25);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, edges);
    gl.drawElements(gl.LINES, 2 * faces.length, gl.UNSIGNED_INT, 0);
  };
  const buffers = { faces: gl.getParameter(gl.ELEMENT_ARRAY_BUFFER_BINDING) };
  const redraw = () => {
    if (!asked) requestAnimationFrame(draw);
    asked = true;
  };
  const turn = (x, y) => {
    view.turn += x;
    view.tilt = Math.min(0, Math.max(-Math.PI, view.tilt + y));
    redraw();
  };
  const move = (x, y) => {
    const unit = Math.hypot(...size) / view.zoom;
    view.x += x * unit;
    view.y -= y * unit;
    redraw();
  };
  const zoom = (factor) => {
    view.zoom = Math.min(200, Math.max(0.3, view.zoom * factor));
    redraw();
  };

  const fingers = new Map();
  const spread = () => {
    const [p, q] = [...fingers.values()];
    return Math.hypot(p.x - q.x, p.y - q.y);
  };
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, { x: e.clientX, y: e.clientY });
  });
  canvas.addEventListener("pointermove", (e) => {
    const was = fingers.get(e.pointerId);
    if (!was) return;
    const before = fingers.size === 2 ? spread() : 0, wide = canvas.clientWidth;
    fingers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    const x = (e.clientX - was.x) / wide, y = (e.clientY - was.y) / wide;
    if (fingers.size === 2) {
      if (before > 0) zoom(spread() / before);
      move(x / 2, y / 2);
    } else if (e.shiftKey || e.buttons & 2) move(x, y);
    else turn(5 * x, 5 * y);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => fingers.delete(e.pointerId));
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    zoom(Math.exp(-0.0015 * e.deltaY));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1), "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15),
  };
  canvas.addEventListener("keydown", (e) => {
    if (!keys[e.key]) return;
    keys[e.key]();
    e.preventDefault();
  });
  document.getElementById("view-home").addEventListener("click", () => {
    view = home();
    redraw();
  });
  document.getElementById("view-wire").addEventListener("change", (e) => {
    wire = e.target.checked;
    if (wire && !edges) {
      const ends = new Uint32Array(2 * faces.length);
      for (let i = 0, j = 0; i < faces.length; i += 3)
        for (let k = 0; k < 3; ++k) {
          ends[j++] = faces[i + k];
          ends[j++] = faces[i + (k + 1) % 3];
        }
      edges = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, edges);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, ends, gl.STATIC_DRAW);
    }
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);
  dark.addEventListener("change", redraw);
  note.hidden = true;
  draw();
})();
)js";

}  // namespace tessera
