// The camera: turning by mouse, touch and arrow keys, and framing what is shown.
const { Box3, OrbitControls, PerspectiveCamera, Vector3 } = THREE;

const VIEW = new Vector3(0.85, 0.62, 1.25).normalize(); // from which side things are seen first
const MARGIN = 0.94; // of what is free is filled
const KEY_TURN = Math.PI / 24;

export class Camera {
  constructor(canvas, onChange) {
    this.lens = new PerspectiveCamera(28, 1, 0.01, 100); // narrow, so that equal hulls look equal
    this.orbit = new OrbitControls(this.lens, canvas);
    this.orbit.enableDamping = false;
    this.orbit.zoomToCursor = true;
    this.orbit.addEventListener("change", onChange);
    canvas.addEventListener("keydown", (event) => this.#turn(event));
    this.lens.position.copy(VIEW).multiplyScalar(6);
  }

  /** The canvas in pixels, and what of it is covered at its upper and lower edge. */
  resize(width, height, { top, bottom }) {
    this.free = { width, height: Math.max(height - top - bottom, height / 3) };
    this.full = height;
    this.lens.aspect = width / height;
    this.lens.setViewOffset(width, height, 0, (bottom - top) / 2, width, height); // the middle of what is free
    this.lens.updateProjectionMatrix();
  }

  /** Show all `points`, from the first side or from where the camera is now. */
  frame(points, { again = false } = {}) {
    const side = again ? this.lens.position.clone().sub(this.orbit.target).normalize() : VIEW;
    const right = new Vector3(0, 1, 0).cross(side).normalize();
    const up = side.clone().cross(right);
    const target = new Box3().setFromPoints(points).getCenter(new Vector3());
    const pixel = Math.tan((this.lens.fov / 2) * (Math.PI / 180)) / (this.full / 2);
    const across = (MARGIN * pixel * this.free.width) / 2;
    const along = (MARGIN * pixel * this.free.height) / 2;
    // A point is inside if |up . p| <= along * depth, depth = distance - side . p; likewise to the right.
    const distances = points.map((point) => {
      const p = point.clone().sub(target);
      return p.dot(side) + Math.max(Math.abs(p.dot(right)) / across, Math.abs(p.dot(up)) / along);
    });
    const distance = Math.max(...distances, 1e-3);
    this.orbit.target.copy(target);
    this.lens.position.copy(target).addScaledVector(side, distance);
    this.lens.near = distance / 100;
    this.lens.far = distance * 20;
    this.lens.updateProjectionMatrix();
    this.orbit.minDistance = distance / 40;
    this.orbit.maxDistance = distance * 6;
    this.orbit.update();
  }

  #turn(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const arm = this.lens.position.clone().sub(this.orbit.target);
    const length = arm.length();
    const azimuth = Math.atan2(arm.x, arm.z) + step[0] * KEY_TURN;
    const polar = Math.min(Math.PI - 0.05, Math.max(0.05, Math.acos(arm.y / length) + step[1] * KEY_TURN));
    this.lens.position.setFromSphericalCoords(length, polar, azimuth).add(this.orbit.target);
    this.orbit.update();
  }
}
