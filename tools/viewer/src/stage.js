// Canvas, camera and the loop: a frame is drawn when something changed, and no other time.
import { PerspectiveCamera, Raycaster, Scene, Sphere, Vector2, Vector3, WebGLRenderer } from "three";
import { look } from "./material.js";
import { clipRange, unitsPerPixel } from "./scale.js";
import { hides } from "./section.js";

export class Stage {
  /** \param panel  covers the left of the canvas */
  constructor(canvas, panel) {
    this.canvas = canvas;
    this.panel = panel;
    this.covered = 0;  // pixels
    // Asked before each frame: whether there is nothing to show yet. Then what loads is looked at all the same, but no frame is
    // drawn or waited for: without a GPU each one takes a tenth of a second, in which nothing else of the page goes on.
    this.waits = () => true;
    this.blank = true;
    const ratio = Math.min(window.devicePixelRatio, 2);
    canvas.width = Math.max(1, Math.floor(canvas.clientWidth * ratio));  // else the buffer is made twice
    canvas.height = Math.max(1, Math.floor(canvas.clientHeight * ratio));
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(ratio);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(50, 1, 0.1, 1000);
    this.camera.position.set(1, -1, 1);
    this.ball = new Sphere(new Vector3(), 1);  // of all that may be shown
    this.size = new Vector2(1, 1);
    this.plane = null;
    this.raycaster = new Raycaster();
    this.raycaster.params.Points.threshold = 0;
    this.changed = this.changed.bind(this);
    this.before = [];  // called with the seconds since the last frame, before it
    this.after = [];
    this.due = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const width = Math.max(1, this.canvas.clientWidth), height = Math.max(1, this.canvas.clientHeight);
    this.renderer.setSize(width, height, false);
    this.size.set(width, height);
    this.camera.aspect = width / height;
    // The middle of the picture is that of what the panel leaves free.
    const right = this.panel.getBoundingClientRect().right;
    this.covered = width > 3 * right ? right : 0;
    this.camera.setViewOffset(width, height, -this.covered / 2, 0, width, height);
    this.changed();
  }

  changed() {
    if (this.due) return;
    this.due = true;
    if (this.blank) setTimeout(() => this.frame(performance.now()));
    else requestAnimationFrame((time) => this.frame(time));
  }

  frame(time) {
    this.due = false;
    const seconds = Math.min(0.1, (time - (this.last ?? time)) / 1000 || 1 / 60);
    this.last = time;
    for (const call of this.before) call(seconds);
    const away = this.camera.position.distanceTo(this.ball.center);
    const { near, far } = clipRange(away, this.ball.radius, this.closest?.() ?? this.ball.radius * 1e-4);
    Object.assign(this.camera, { near, far });
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    look.upSeen.value.set(0, 0, 1).transformDirection(this.camera.matrixWorldInverse);
    look.cutting.value = this.plane !== null;
    if (this.plane) {
      look.cutNormal.value.set(...this.plane.normal);
      look.cutOffset.value = this.plane.offset;
    }
    for (const call of this.update ?? []) call();
    this.blank = this.blank && this.waits();
    if (this.blank) return;
    this.renderer.render(this.scene, this.camera);
    for (const call of this.after) call();
  }

  /** What is seen at a pixel of the canvas: the nearest hit that no section hides; beside it where a ray slips between tiles. */
  pick(x, y) {
    this.camera.updateMatrixWorld();
    for (const [i, j] of [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]]) {
      this.raycaster.setFromCamera(new Vector2(2 * (x + i) / this.size.x - 1, 1 - 2 * (y + j) / this.size.y), this.camera);
      this.raycaster.near = this.camera.near;
      // Points have no extent: one within three pixels of the ray, at the distance of the middle of all, is meant.
      const away = this.camera.position.distanceTo(this.ball.center);
      this.raycaster.params.Points.threshold = 3 * unitsPerPixel(away, this.camera.fov * Math.PI / 180, this.size.y);
      const hit = this.firstHit();
      if (hit) return hit;
    }
    return null;
  }

  /** Height of what lies below a point, or null. */
  below(from) {
    this.raycaster.set(from, new Vector3(0, 0, -1));
    this.raycaster.near = 0;
    return this.firstHit()?.point.z ?? null;
  }

  firstHit() {
    return this.raycaster.intersectObjects(this.scene.children, true)
      .find((hit) => !hides(this.plane, hit.point.toArray())) ?? null;
  }
}
