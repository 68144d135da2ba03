// Jolt: a ConvexHullShape of the points of each hull, and a compound of all.

import { GRAVITY, STEP, load, run, version } from "./harness.mjs";

const NAME = "jolt-physics";
const { default: make } = await load(NAME, "dist/jolt-physics.wasm-compat.js");
const Jolt = await make();
const FIXED = 0, MOVING = 1;  // layers

function world() {
  const settings = new Jolt.JoltSettings();
  const pairs = new Jolt.ObjectLayerPairFilterTable(2);
  pairs.EnableCollision(FIXED, MOVING);
  pairs.EnableCollision(MOVING, MOVING);
  const phases = new Jolt.BroadPhaseLayerInterfaceTable(2, 2);
  phases.MapObjectToBroadPhaseLayer(FIXED, new Jolt.BroadPhaseLayer(0));
  phases.MapObjectToBroadPhaseLayer(MOVING, new Jolt.BroadPhaseLayer(1));
  settings.mObjectLayerPairFilter = pairs;
  settings.mBroadPhaseLayerInterface = phases;
  settings.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(phases, 2, pairs, 2);
  return new Jolt.JoltInterface(settings);
}

const jolt = world();
const upright = new Jolt.Quat(0, 0, 0, 1);

function take(points) {
  const [usual, exact] = [hull(points), hull(points, 0)];
  return { shape: usual.shape, usual: kept(usual), ...kept(exact) };
}

function hull(points, tolerance) {
  const settings = new Jolt.ConvexHullShapeSettings();
  for (const [x, y, z] of points) settings.mPoints.push_back(new Jolt.Vec3(x, y, z));
  if (tolerance !== undefined) settings.mHullTolerance = tolerance;
  const made = settings.Create();
  if (made.HasError()) return { shape: null, error: made.GetError().c_str() };
  const shape = made.Get();
  shape.AddRef();
  return { shape };
}

function kept({ shape, error }) {
  return shape ? { vertices: corners(shape), volume: shape.GetVolume() } : { error };
}

function corners(shape) {
  const drawn = new Jolt.ShapeGetTriangles(
    shape, Jolt.AABox.prototype.sBiggest(), shape.GetCenterOfMass(), upright, new Jolt.Vec3(1, 1, 1),
  );
  const numbers = new Float32Array(Jolt.HEAPF32.buffer, drawn.GetVerticesData(), drawn.GetVerticesSize() / 4);
  const points = Array.from({ length: numbers.length / 3 }, (_, i) => String(numbers.slice(3 * i, 3 * i + 3)));
  return new Set(points).size;
}

function fall(shapes, starts, steps) {
  const system = jolt.GetPhysicsSystem(), bodies = system.GetBodyInterface();
  system.SetGravity(new Jolt.Vec3(0, 0, GRAVITY));
  const add = (shape, [x, y, z], motion, layer) => {
    const described = new Jolt.BodyCreationSettings(shape, new Jolt.RVec3(x, y, z), upright, motion, layer);
    described.mFriction = 0.8;
    const body = bodies.CreateBody(described);
    bodies.AddBody(body.GetID(), Jolt.EActivation_Activate);
    return body;
  };
  const all = new Jolt.StaticCompoundShapeSettings();
  for (const shape of shapes) all.AddShapeShape(new Jolt.Vec3(0, 0, 0), upright, shape, 0);
  const whole = all.Create();
  if (whole.HasError()) throw new Error(whole.GetError().c_str());
  const floor = add(new Jolt.BoxShape(new Jolt.Vec3(20, 20, 1)), [0, 0, -1], Jolt.EMotionType_Static, FIXED);
  const falling = starts.map((start) => add(whole.Get(), start, Jolt.EMotionType_Dynamic, MOVING));
  for (let i = 0; i < steps; i++) jolt.Step(STEP, 1);
  const ended = falling.map((body) => {
    const [p, q] = [body.GetPosition(), body.GetRotation()];
    const [v, w] = [body.GetLinearVelocity(), body.GetAngularVelocity()];
    const said = { pose: [p.GetX(), p.GetY(), p.GetZ(), q.GetX(), q.GetY(), q.GetZ(), q.GetW()] };
    return { ...said, velocity: [v.GetX(), v.GetY(), v.GetZ(), w.GetX(), w.GetY(), w.GetZ()] };
  });
  for (const body of [floor, ...falling]) bodies.RemoveBody(body.GetID());
  return ended;
}

run(`Jolt (${NAME} ${version(NAME)})`, { take, fall });
