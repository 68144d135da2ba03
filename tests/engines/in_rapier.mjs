// Rapier: a collider for each hull, of its vertices and faces, which are taken to be convex as they are.

import { GRAVITY, STEP, load, run, version, volume } from "./harness.mjs";

const NAME = "@dimforge/rapier3d-compat";
const { default: RAPIER } = await load(NAME, "dist/rapier.mjs");
await RAPIER.init();

function world() {
  const made = new RAPIER.World({ x: 0, y: 0, z: GRAVITY });
  made.timestep = STEP;
  return made;
}

const trial = world();

function take(points, faces) {
  const shape = RAPIER.ColliderDesc.convexMesh(new Float32Array(points.flat()), new Uint32Array(faces.flat()));
  if (shape === null) return { shape, error: "not a convex mesh" };
  const collider = trial.createCollider(shape);
  const three = (numbers) => Array.from({ length: numbers.length / 3 }, (_, i) => [...numbers.slice(3 * i, 3 * i + 3)]);
  const corners = three(collider.vertices());
  // Not collider.volume(): of thin hulls, Rapier's integral is up to 25 % off.
  return { shape, vertices: corners.length, volume: volume(corners, three(collider.indices())) };
}

function fall(shapes, starts, steps) {
  const here = world();
  here.createCollider(RAPIER.ColliderDesc.cuboid(20, 20, 1).setTranslation(0, 0, -1).setFriction(0.8));
  const bodies = starts.map(([x, y, z]) => {
    const body = here.createRigidBody(RAPIER.RigidBodyDesc.dynamic().setTranslation(x, y, z));
    for (const shape of shapes) here.createCollider(shape.setFriction(0.8).setDensity(1000), body);
    return body;
  });
  for (let i = 0; i < steps; i++) here.step();
  return bodies.map((body) => {
    const [p, q, v, w] = [body.translation(), body.rotation(), body.linvel(), body.angvel()];
    return { pose: [p.x, p.y, p.z, q.x, q.y, q.z, q.w], velocity: [v.x, v.y, v.z, w.x, w.y, w.z] };
  });
}

run(`Rapier (${NAME} ${version(NAME)})`, { take, fall });
