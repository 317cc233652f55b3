// Measuring by clicks: points, and chains of distances.
import { apply } from "./frame.js";
import { csv } from "./measure.js";
import { measurementRows } from "./overlay.js";

export class Tools {
  /** \param scanOf  {frame, step, more(hit, point)}: how a hit becomes coordinates */
  constructor(stage, scan) {
    Object.assign(this, { stage, scan, tool: null, measurements: [] });
    const canvas = stage.canvas;
    let pressed = null;
    canvas.addEventListener("pointerdown", (e) => (pressed = e.button === 0 ? [e.offsetX, e.offsetY] : null));
    canvas.addEventListener("pointerup", (e) => {
      if (!this.tool || !pressed || e.button !== 0) return;
      if (Math.hypot(e.offsetX - pressed[0], e.offsetY - pressed[1]) < 5 && e.detail < 2) this.click(e.offsetX, e.offsetY);
    });
    document.getElementById("clear").addEventListener("click", () => this.clear());
    document.getElementById("copy").addEventListener("click", () => this.copy());
  }

  use(tool) {
    this.finish();
    this.tool = this.tool === tool ? null : tool;
    this.stage.canvas.classList.toggle("measuring", this.tool !== null);
    for (const button of document.querySelectorAll("[data-tool]"))
      button.setAttribute("aria-pressed", button.dataset.tool === this.tool);
    this.show();
  }

  /** \returns the point of the scan, or null where nothing is */
  click(x, y) {
    const hit = this.stage.pick(x, y);
    if (!hit) return null;
    const point = apply(this.scan.frame.toScan, hit.point.toArray());
    const open = this.measurements.at(-1);
    if (this.tool === "distance" && open?.open) {
      open.points.push(point);
      open.scene.push(hit.point.clone());
    } else {
      this.measurements.push({ kind: this.tool, points: [point], scene: [hit.point.clone()], open: this.tool === "distance",
                               more: this.tool === "point" ? this.scan.more(hit) : [] });
    }
    this.show();
    return point;
  }

  /** Ends a chain; one point is none. */
  finish() {
    const last = this.measurements.at(-1);
    if (!last?.open) return false;
    last.open = false;
    if (last.points.length < 2) this.measurements.pop();
    this.show();
    return true;
  }

  clear() {
    this.measurements.length = 0;
    this.show();
  }

  async copy() {
    const text = csv(this.measurements, this.scan.step);
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // Pages of file: may not use the clipboard in some browsers: the old way.
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
  }

  show() {
    const list = document.getElementById("list");
    list.replaceChildren(...this.measurements.map((m, i) => {
      const table = document.createElement("table"), caption = table.createCaption();
      caption.textContent = `${m.kind === "point" ? "Point" : "Distance"} ${i + 1}`;
      for (const [name, value] of measurementRows(m, this.scan.step, this.scan.up)) {
        const row = table.insertRow();
        row.insertCell().textContent = name;
        row.insertCell().textContent = value;
      }
      return table;
    }));
    const box = document.getElementById("measured");
    box.hidden = this.measurements.length === 0;
    box.scrollTop = box.scrollHeight;
    this.stage.changed();
  }
}
