// Ways to move: around what is looked at (drag turns, right drag or Shift moves, the wheel comes closer to the pointer),
// or on foot (keys walk, drag looks about, feet keep to what lies below).
import { Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { fitted } from "./scale.js";

const UP = new Vector3(0, 0, 1);
const KEYS = {
  KeyW: [0, 1, 0], ArrowUp: [0, 1, 0], KeyS: [0, -1, 0], ArrowDown: [0, -1, 0], KeyA: [-1, 0, 0], ArrowLeft: [-1, 0, 0],
  KeyD: [1, 0, 0], ArrowRight: [1, 0, 0], KeyE: [0, 0, 1], PageUp: [0, 0, 1], KeyQ: [0, 0, -1], PageDown: [0, 0, -1],
};
const STEEPEST = Math.PI / 2 - 0.01;

export class Navigation {
  /**
   * \param below   (Vector3) => height of what lies below a point of the scene, null where nothing does
   * \param looked  () => the point in the middle of the picture, null where nothing is
   */
  constructor(camera, canvas, changed, below, looked) {
    Object.assign(this, { camera, canvas, changed, below, looked, walking: false, speed: 1, eye: 1.7, held: new Set() });
    camera.up.copy(UP);
    const orbit = this.orbit = new OrbitControls(camera, canvas);
    orbit.zoomToCursor = true;
    orbit.screenSpacePanning = true;
    orbit.maxPolarAngle = Math.PI;
    orbit.rotateSpeed = 0.8;
    orbit.zoomSpeed = 1.6;
    orbit.addEventListener("change", changed);
    this.listen();
  }

  listen() {
    const { canvas, held } = this;
    let finger = null;
    canvas.addEventListener("pointerdown", (e) => {
      canvas.focus();
      if (!this.walking || e.button !== 0) return;
      finger = { id: e.pointerId, x: e.clientX, y: e.clientY };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!this.walking || !finger || e.pointerId !== finger.id) return;
      const turn = this.camera.fov * Math.PI / 180 / canvas.clientHeight;
      this.look((e.clientX - finger.x) * turn, (e.clientY - finger.y) * turn);
      finger = { id: e.pointerId, x: e.clientX, y: e.clientY };
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (finger = null));
    canvas.addEventListener("wheel", (e) => {
      if (!this.walking) return;
      e.preventDefault();
      this.speed *= Math.exp(-0.001 * e.deltaY);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      if (!this.walking || e.ctrlKey || e.metaKey || e.altKey) return;
      if (KEYS[e.code]) {
        held.add(e.code);
        this.changed();
        e.preventDefault();
      }
      if (e.key === "Shift") held.add("fast");
    });
    canvas.addEventListener("keyup", (e) => held.delete(e.key === "Shift" ? "fast" : e.code));
    canvas.addEventListener("blur", () => held.clear());
  }

  /** Turns the head, by radians. */
  look(left, up) {
    const direction = this.direction();
    const tilt = Math.asin(Math.max(-1, Math.min(1, direction.z)));
    const next = Math.max(-STEEPEST, Math.min(STEEPEST, tilt + up));
    const turned = Math.atan2(direction.y, direction.x) + left;
    direction.set(Math.cos(next) * Math.cos(turned), Math.cos(next) * Math.sin(turned), Math.sin(next));
    this.face(direction);
  }

  direction() {
    return this.camera.getWorldDirection(new Vector3());
  }

  face(direction) {
    this.camera.lookAt(this.camera.position.clone().add(direction));
    this.changed();
  }

  /** \param eye  height of the eyes above the ground, speed a second: scene units */
  walk(on, eye, speed) {
    if (on === this.walking) return;
    this.walking = on;
    this.orbit.enabled = !on;
    this.held.clear();
    if (on) {
      this.eye = eye;
      this.speed = speed;
      const direction = this.direction();
      // Down from the bird's view, to a few steps before what it looked at.
      const goal = this.looked();
      if (goal && this.camera.position.distanceTo(goal) > 12 * eye) {
        const level = new Vector3(direction.x, direction.y, 0);
        if (level.lengthSq() < 1e-6) level.set(0, 1, 0);
        level.normalize();
        const at = goal.clone().addScaledVector(level, -6 * eye).setZ(goal.z + 4 * eye);
        at.z = (this.below(at) ?? goal.z) + eye;
        this.camera.position.copy(at);
        direction.copy(level).setZ(-0.05).normalize();
      }
      this.face(direction);
    } else {
      this.orbit.target.copy(this.camera.position).addScaledVector(this.direction(), 8 * this.eye);
      this.orbit.update();
    }
    this.changed();
  }

  /** \returns whether it moves on */
  step(seconds) {
    if (!this.walking || [...this.held].every((key) => !KEYS[key])) return false;
    const direction = this.direction(), level = new Vector3(direction.x, direction.y, 0);
    if (level.lengthSq() < 1e-9) level.set(0, 1, 0);
    level.normalize();
    const right = new Vector3().crossVectors(level, UP), move = new Vector3();
    let free = false;
    for (const key of this.held) {
      if (!KEYS[key]) continue;
      const [side, ahead, rise] = KEYS[key];
      move.addScaledVector(right, side).addScaledVector(level, ahead).addScaledVector(UP, rise);
      free ||= rise !== 0;
    }
    const far = this.speed * seconds * (this.held.has("fast") ? 4 : 1);
    const position = this.camera.position.addScaledVector(move, far);
    // Feet follow steps and slopes, not walls: what rises by more than the eyes' height is gone through.
    if (!free) {
      const ground = this.below(position.clone().setZ(position.z + 0.2 * this.eye));
      if (ground !== null && position.z - ground < 3 * this.eye)
        position.z += (ground + this.eye - position.z) * Math.min(1, 12 * seconds);
    }
    this.changed();
    return true;
  }

  /** Looks at all of these points from a direction (to the eye). \param wide  pixels of the canvas that nothing covers */
  frame(points, from, wide) {
    const tall = Math.max(1, this.canvas.clientHeight), half = Math.tan(this.camera.fov * Math.PI / 360);
    const { eye, target } = fitted(points, from, [half * wide / tall, half]);
    this.orbit.target.set(...target);
    this.camera.position.set(...eye);
    this.orbit.update();
    this.changed();
  }

  /** Turns about this point from now on. */
  centre(point) {
    const away = this.camera.position.clone().sub(this.orbit.target);
    this.orbit.target.copy(point);
    const far = Math.min(away.length(), this.camera.position.distanceTo(point));
    this.camera.position.copy(point).addScaledVector(away.normalize(), Math.max(far, 1e-9));
    this.orbit.update();
  }
}
