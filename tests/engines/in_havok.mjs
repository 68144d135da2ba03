// Havok: a convex hull of the points of each hull, and a container of all.

import { readFileSync } from "node:fs";
import { GRAVITY, STEP, load, packageFile, run, version } from "./harness.mjs";

const NAME = "@babylonjs/havok";
const { default: make } = await load(NAME, "lib/esm/HavokPhysics_es.js");
const havok = await make({ wasmBinary: readFileSync(packageFile(NAME, "lib/esm/HavokPhysics.wasm")) });
const UPRIGHT = [0, 0, 0, 1], UNSCALED = [1, 1, 1];

function ok([result, ...values]) {
  if (result !== havok.Result.RESULT_OK) throw new Error(`Havok: ${result}`);
  return values[0];
}

function take(points) {
  const buffer = havok._malloc(12 * points.length);
  new Float32Array(havok.HEAPU8.buffer, buffer, 3 * points.length).set(points.flat());
  const [result, shape] = havok.HP_Shape_CreateConvexHull(buffer, points.length);
  havok._free(buffer);
  if (result !== havok.Result.RESULT_OK) return { shape: null, error: "not taken" };
  havok.HP_Shape_SetDensity(shape, 1);
  const drawn = ok(havok.HP_Shape_CreateDebugDisplayGeometry(shape));
  const [address, count] = ok(havok.HP_DebugGeometry_GetInfo(drawn));
  const corners = new Float32Array(havok.HEAPU8.buffer, address, 3 * count);
  const kept = new Set(Array.from({ length: count }, (_, i) => String(corners.slice(3 * i, 3 * i + 3))));
  return { shape, vertices: kept.size, volume: ok(havok.HP_Shape_BuildMassProperties(shape))[1] };
}

function fall(shapes, starts, steps) {
  const world = ok(havok.HP_World_Create());
  havok.HP_World_SetGravity(world, [0, 0, GRAVITY]);
  havok.HP_World_SetIdealStepTime(world, STEP);
  const add = (shape, start, motion) => {
    const body = ok(havok.HP_Body_Create());
    havok.HP_Body_SetShape(body, shape);
    havok.HP_Body_SetMotionType(body, motion);
    if (motion === havok.MotionType.DYNAMIC)
      havok.HP_Body_SetMassProperties(body, ok(havok.HP_Shape_BuildMassProperties(shape)));
    havok.HP_Body_SetQTransform(body, [start, UPRIGHT]);
    havok.HP_World_AddBody(world, body, false);
    return body;
  };
  add(ok(havok.HP_Shape_CreateBox([0, 0, 0], UPRIGHT, [40, 40, 2])), [0, 0, -1], havok.MotionType.STATIC);
  const all = ok(havok.HP_Shape_CreateContainer());
  for (const shape of shapes) {
    havok.HP_Shape_SetDensity(shape, 1000);
    havok.HP_Shape_AddChild(all, shape, [[0, 0, 0], UPRIGHT, UNSCALED]);
  }
  const bodies = starts.map((start) => add(all, start, havok.MotionType.DYNAMIC));
  for (let i = 0; i < steps; i++) havok.HP_World_Step(world, STEP);
  return bodies.map((body) => {
    const [place, turn] = ok(havok.HP_Body_GetQTransform(body));
    const velocities = [havok.HP_Body_GetLinearVelocity(body), havok.HP_Body_GetAngularVelocity(body)].map(ok);
    return { pose: [...place, ...turn], velocity: velocities.flat() };
  });
}

run(`Havok (${NAME} ${version(NAME)})`, { take, fall });
