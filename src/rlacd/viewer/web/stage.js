// The 3-D view: input, hulls, balls and the error heat map. It draws only when something changed.
import { floats, indices } from "page/arrays";
import { Camera } from "page/camera";
import { makeGrid } from "page/ground";
const { Box3, BufferAttribute, BufferGeometry, Color, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, Vector3 } = THREE;

const CREASE = 18; // degrees between facets from which their edge is drawn
const HEAT = ["#eef1f4", "#fde3a7", "#f9b45e", "#e8703a", "#b92b42", "#641a4e"].map((hex) => new Color(hex));
export const HEAT_COLORS = ["#eef1f4", "#fde3a7", "#f9b45e", "#e8703a", "#b92b42", "#641a4e"];
const WALL = new Color("#c3c9d1");
const TOUCHING = new Color("#e5231b");
const [X, Y, Z, BACK] = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1), new Vector3(0, 0, -1)];

export class Stage {
  /** `onHover(part or null, x, y)` and `onPick(part or null)` tell what the pointer does, `onView(pixels)` how long
   * a frame unit is in the middle of the view. */
  constructor(canvas, { onHover, onPick, onView }) {
    this.onView = onView;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera = new Camera(canvas, () => this.draw());
    this.scene = new THREE.Scene();
    this.lights = this.#light();
    this.root = new Group(); // turned so that the input's up is up
    this.scene.add(this.root);
    this.links = []; // of a robot: what moves as one
    this.inputs = [];
    this.kept = []; // of a robot: primitives, which stay beside the hulls
    this.parts = [];
    this.heat = null;
    this.balls = null;
    this.look = { input: "ghost", hulls: "solid", edges: true, heat: false, balls: false, grid: true, pull: 0 };
    this.grid = null;
    this.hovered = this.picked = null;
    this.#watchPointer(onHover, onPick);
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    this.#resize();
  }

  /** Show another decomposition, or an input without hulls; the camera stays where it is unless told to frame it. */
  load(scene, { frame = false } = {}) {
    this.#empty();
    this.links = (scene.robot?.links ?? []).map(() => new Group());
    for (const link of this.links) link.matrixAutoUpdate = false;
    if (this.links.length) this.root.add(...this.links);
    this.inputs = scene.input.map((mesh, link) => this.#addInput(mesh, link));
    this.kept = scene.kept.map((mesh) => this.#addKept(mesh));
    this.parts = scene.parts.map((part, index) => this.#addPart(part, index));
    this.middle = this.#boxes().reduce((all, box) => all.union(box), new Box3()).getCenter(new Vector3());
    this.balls = scene.balls && this.#addBalls(scene.balls);
    this.grid = makeGrid(scene.scale);
    this.scene.add(this.grid);
    this.hovered = this.picked = null;
    this.refresh();
    if (frame) this.turn(scene.up);
    else {
      this.#ground();
      if (this.look.pull) this.fit();
    }
  }

  /** Let an axis of the input, "x", "y" or "z", point up; nothing is mirrored. */
  turn(up) {
    const [x, y, z] = { x: [Y, X, BACK], y: [X, Y, Z], z: [X, BACK, Y] }[up]; // where its axes go
    this.root.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(x, y, z));
    this.#ground();
    this.fit(false);
  }

  /** Put the grid under what there is. */
  #ground() {
    if (!this.grid) return;
    this.root.updateMatrixWorld(true);
    const all = [...this.parts.map((part) => part.box), ...this.inputs.map(boxOf), ...this.kept.map(({ layers }) => boxOf(layers))];
    const points = all.flatMap(cornersOf).map((corner) => this.root.localToWorld(corner));
    if (points.length === 0) return;
    const box = new Box3().setFromPoints(points);
    const middle = box.getCenter(new Vector3());
    this.grid.position.set(middle.x, box.min.y - 1e-3, middle.z);
    this.draw();
  }

  /** Boxes at rest around the hulls, or around the input without any. */
  #boxes() {
    if (this.parts.length) return [...this.parts.map((part) => part.box), ...this.kept.map(({ layers }) => boxOf(layers))];
    return this.inputs.length ? this.inputs.map(boxOf) : [new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1))];
  }

  /** Put the links of a robot where matrices say. */
  move(matrices) {
    matrices.forEach((matrix, link) => this.links[link].matrix.copy(matrix));
    this.draw();
  }

  /** Show some links of a robot in red. */
  touch(links) {
    for (const { layers, link } of [...this.parts, ...this.kept]) layers.paint(links.has(link) ? TOUCHING : layers.color);
    this.draw();
  }

  loadHeat(heat) {
    this.heat = heat.parts.map((part, index) => {
      const geometry = geometryOf(part);
      const distance = floats(part.distance);
      const colors = new Float32Array(3 * distance.length);
      distance.forEach((value, i) => heatColor(value, heat.max).toArray(colors, 3 * i));
      geometry.setAttribute("color", new BufferAttribute(colors, 3));
      const mesh = new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, ...FLAT }));
      this.parts[index].group.add(mesh);
      return mesh;
    });
    this.refresh();
  }

  /** Change what is shown: any of the keys of `look`. */
  set(change) {
    Object.assign(this.look, change);
    this.refresh();
  }

  hover(index) {
    if (index === this.hovered) return;
    this.hovered = index;
    this.refresh();
  }

  pick(index) {
    this.picked = index;
    this.refresh();
  }

  fit(again = true) {
    this.root.updateMatrixWorld(true);
    const drawn = [...this.parts.map(({ group, box }) => [group, box]), ...this.kept.map(({ layers }) => [layers, boxOf(layers)])];
    const corners = this.parts.length
      ? drawn.flatMap(([group, box]) => cornersOf(box).map((corner) => group.localToWorld(corner)))
      : this.#boxes().flatMap((box) => cornersOf(box).map((corner) => this.root.localToWorld(corner)));
    if (corners.length) this.camera.frame(corners, { again });
    this.draw();
  }

  /** Bring every object in line with `look`. */
  refresh() {
    const { input, hulls, edges, heat, balls, grid, pull } = this.look;
    for (const each of this.inputs) each.show(this.parts.length ? input : "solid");
    for (const { layers, centre } of this.kept) {
      layers.position.copy(centre).sub(this.middle).multiplyScalar(pull);
      layers.show(this.picked === null ? hulls : "ghost");
    }
    if (this.grid) this.grid.visible = grid && pull === 0;
    this.parts.forEach((part, index) => {
      const alone = this.picked !== null;
      const mine = index === this.picked;
      const mode = alone && !mine ? "ghost" : hulls;
      const hot = heat && this.heat !== null && mode !== "off" && mode !== "ghost";
      part.group.position.copy(part.centre).sub(this.middle).multiplyScalar(pull);
      part.layers.show(hot ? "off" : mode);
      if (this.heat) this.heat[index].visible = hot;
      part.layers.glow(index === this.hovered && !hot);
      part.edges.visible = hulls !== "off" && (edges || index === this.hovered) && (!alone || mine || index === this.hovered);
      part.edges.material.color.copy(index === this.hovered ? this.ink : part.line);
      part.edges.material.opacity = index === this.hovered ? 1 : hot ? 0.25 : 0.55;
    });
    if (this.balls) this.balls.visible = balls;
    this.draw();
  }

  /** Draw with the next frame, once however often it is asked for. */
  draw() {
    if (this.due) return;
    this.due = requestAnimationFrame(() => {
      this.due = null;
      this.lights.position.copy(this.camera.lens.position);
      this.lights.quaternion.copy(this.camera.lens.quaternion);
      this.renderer.render(this.scene, this.camera.lens);
      const { lens, orbit } = this.camera;
      const across = 2 * Math.tan((lens.fov / 2) * (Math.PI / 180)) * lens.position.distanceTo(orbit.target);
      this.onView(this.canvas.clientHeight / across);
    });
  }

  #light() {
    const lamps = new Group(); // they move with the eye, so that no side is ever dark
    const key = new THREE.DirectionalLight("#fff6ea", 2.1);
    key.position.set(-2.2, 3.2, 2);
    const fill = new THREE.DirectionalLight("#dfeaff", 0.7);
    fill.position.set(3, -0.5, 1.5);
    lamps.add(key, key.target, fill, fill.target);
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#aeb6c2", 1.5), lamps);
    this.ink = new Color("#101418");
    return lamps;
  }

  #addInput(mesh, link) {
    const layers = new Layers(geometryOf(mesh), new Color("#9aa3ae"));
    (this.links[link] ?? this.root).add(layers);
    return layers;
  }

  #addKept(mesh) {
    const layers = new Layers(geometryOf(mesh), new Color("#c9ced6"));
    (this.links[mesh.link] ?? this.root).add(layers);
    return { layers, link: mesh.link, centre: boxOf(layers).getCenter(new Vector3()) };
  }

  #addPart(part, index) {
    const geometry = geometryOf(part);
    const color = new Color(part.color);
    const group = new Group();
    const layers = new Layers(geometry, color, index, part.rank ?? 0);
    const line = color.clone().multiplyScalar(0.35);
    const edges = new THREE.LineSegments(
      new THREE.EdgesGeometry(geometry, CREASE),
      new THREE.LineBasicMaterial({ color: line, transparent: true, opacity: 0.55 }),
    );
    edges.renderOrder = 4;
    group.add(layers, edges);
    (this.links[part.link] ?? this.root).add(group);
    geometry.computeBoundingBox();
    return { group, layers, edges, line, link: part.link, centre: geometry.boundingBox.getCenter(new Vector3()), box: geometry.boundingBox };
  }

  #addBalls({ centres, radii }) {
    const places = floats(centres);
    const sizes = floats(radii);
    const ball = new THREE.IcosahedronGeometry(1, sizes.length > 800 ? 2 : 4);
    const material = new MeshLambertMaterial({ color: "#3d8fd6", transparent: true, opacity: 0.55 });
    const balls = new THREE.InstancedMesh(ball, material, sizes.length);
    const matrix = new THREE.Matrix4();
    sizes.forEach((size, i) => {
      matrix.makeScale(size, size, size).setPosition(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
      balls.setMatrixAt(i, matrix);
    });
    balls.renderOrder = 5;
    this.root.add(balls);
    return balls;
  }

  #empty() {
    for (const thing of [...this.inputs, ...this.kept.map(({ layers }) => layers), this.balls, this.grid, ...this.parts.map((part) => part.group), ...this.links]) {
      if (!thing) continue;
      thing.traverse((node) => {
        node.geometry?.dispose();
        node.material?.dispose();
      });
      thing.removeFromParent();
    }
    this.heat = this.balls = this.grid = null;
    this.inputs = this.kept = this.parts = this.links = [];
  }

  #resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    const toolbar = document.getElementById("toolbar");
    const covered = getComputedStyle(toolbar).position === "absolute" ? toolbar.offsetHeight + 24 : 32;
    this.camera.resize(clientWidth, clientHeight, { top: 84, bottom: Math.min(covered, clientHeight / 3) });
    this.draw();
  }

  /** The part under the pointer, or null. */
  #partAt(event) {
    const frame = this.canvas.getBoundingClientRect();
    const spot = new THREE.Vector2(
      ((event.clientX - frame.left) / frame.width) * 2 - 1,
      1 - ((event.clientY - frame.top) / frame.height) * 2,
    );
    const ray = new THREE.Raycaster();
    ray.setFromCamera(spot, this.camera.lens);
    const bodies = this.look.hulls === "off" ? [] : this.parts.map((part) => part.layers.body);
    return ray.intersectObjects(bodies, false)[0]?.object.userData.part ?? null;
  }

  #watchPointer(onHover, onPick) {
    let down = null;
    this.canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) onHover(this.#partAt(event), event.clientX, event.clientY);
    });
    this.canvas.addEventListener("pointerleave", () => onHover(null, 0, 0));
    this.canvas.addEventListener("pointerup", (event) => {
      const still = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4;
      if (still && event.button === 0) onPick(this.#partAt(event));
    });
  }
}

// Faces are pushed back a little so that edges lie on them. Hulls that overlap can have a facet in one plane: each hue,
// which no neighbour has, is pushed back by another step, so that one of them is seen and they do not flicker. Veils and
// the input are pushed most: where a hull has a face in common with the input, the hull is seen.
const STEP = 6; // smallest differences of depth
const BODY = { side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
const FLAT = { ...BODY, flatShading: true };
const VEIL = { ...FLAT, transparent: true, depthWrite: false };
const pushed = (rank) => ({ polygonOffsetFactor: 1 + rank / 16, polygonOffsetUnits: 1 + STEP * rank });
const BACKMOST = 13;

/** A body that is solid, glass or ghost. Glass and ghost first fill the depth, so that only their front is seen. */
class Layers extends Group {
  constructor(geometry, color, part = null, rank = BACKMOST) {
    super();
    this.color = color;
    this.body = new Mesh(geometry, new MeshLambertMaterial({ color, ...FLAT, ...pushed(rank) }));
    this.body.userData.part = part;
    this.depth = new Mesh(geometry, new MeshBasicMaterial({ ...BODY, ...pushed(rank + 1), colorWrite: false }));
    this.veil = new Mesh(geometry, new MeshLambertMaterial({ color, ...VEIL, ...pushed(rank + 1) }));
    this.depth.renderOrder = 2;
    this.veil.renderOrder = 3;
    this.add(this.body, this.depth, this.veil);
  }

  show(mode) {
    const clear = mode === "glass" || mode === "ghost";
    this.body.visible = mode === "solid";
    this.depth.visible = mode === "glass";
    this.veil.visible = clear;
    this.veil.material.opacity = mode === "glass" ? 0.45 : 0.13;
  }

  paint(color) {
    for (const { material } of [this.body, this.veil]) material.color.copy(color);
  }

  glow(on) {
    for (const { material } of [this.body, this.veil]) {
      material.emissive.copy(this.color).multiplyScalar(on ? 0.45 : 0);
    }
  }
}

function geometryOf({ vertices, faces }) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(floats(vertices), 3));
  geometry.setIndex(new BufferAttribute(indices(faces), 1));
  return geometry;
}

function boxOf({ body: { geometry } }) {
  if (!geometry.boundingBox) geometry.computeBoundingBox();
  return geometry.boundingBox;
}

function cornersOf({ min, max }) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map(
    (i) => new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z),
  );
}

function heatColor(distance, most) {
  if (distance < 0) return WALL;
  const at = most > 0 ? Math.min(distance / most, 1) * (HEAT.length - 1) : 0;
  const low = Math.min(Math.floor(at), HEAT.length - 2);
  return HEAT[low].clone().lerp(HEAT[low + 1], at - low);
}
