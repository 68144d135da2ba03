// What every engine in JavaScript does with a task: take each hull as a convex shape, and let bodies fall.
// A task lists bodies, {hulls: [{points, faces}], falls: [{starts: [[x, y, z]], seconds}]}; z points up, the floor is
// z = 0.

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const FOLDER = process.env.ENGINES;  // holds node_modules

export const STEP = 1 / 240;  // s
export const GRAVITY = -9.81;  // m/s²

export function packageFile(name, file) {
  return join(FOLDER, "node_modules", name, file);
}

export function load(name, file) {
  return import(pathToFileURL(packageFile(name, file)));
}

export function version(name) {
  return JSON.parse(readFileSync(packageFile(name, "package.json"))).version;
}

// The volume of a closed surface of polygons.
export function volume(points, polygons) {
  let six = 0;
  for (const [first, ...rest] of polygons)
    for (let i = 0; i + 1 < rest.length; i++) {
      const [a, b, c] = [points[first], points[rest[i]], points[rest[i + 1]]];
      six += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
  return Math.abs(six) / 6;
}

// `take(points, faces)` gives a shape and what the engine says about it; `fall(shapes, starts, steps)` gives the pose
// [x, y, z, qx, qy, qz, qw] and the velocity of each body at the end.
export function run(engine, { take, fall }) {
  const [task, answer] = process.argv.slice(2);
  const bodies = JSON.parse(readFileSync(task)).map(({ hulls, falls }) => {
    const taken = hulls.map(({ points, faces }) => take(points, faces));
    const shapes = taken.map(({ shape }) => shape);
    return {
      hulls: taken.map(({ shape, ...said }) => said),
      falls: falls.map(({ starts, seconds }) => fall(shapes, starts, Math.round(seconds / STEP))),
    };
  });
  writeFileSync(answer, JSON.stringify({ engine, bodies }));
  process.exit(0);
}
