// PhysX 5: cooks each hull from its points; with the argument "gpu", for GPUs.

import { readFileSync } from "node:fs";
import { GRAVITY, STEP, load, packageFile, run, version, volume } from "./harness.mjs";

const NAME = "physx-js-webidl";
// The package is made for browsers, and refuses to run where there is a version of Node.
Object.defineProperty(process, "versions", { value: {} });
globalThis.window = globalThis;
const { default: make } = await load(NAME, `${NAME}.mjs`);
const PhysX = await make({ wasmBinary: readFileSync(packageFile(NAME, `${NAME}.wasm`)) });
const top = PhysX.PxTopLevelFunctions.prototype;
const at = PhysX.NativeArrayHelpers.prototype;

const foundation = top.CreateFoundation(top.PHYSICS_VERSION, new PhysX.PxDefaultAllocator(), new PhysX.PxDefaultErrorCallback());
const scale = new PhysX.PxTolerancesScale();
const physics = top.CreatePhysics(top.PHYSICS_VERSION, foundation, scale);
const cooking = new PhysX.PxCookingParams(scale);
cooking.buildGPUData = process.argv[4] === "gpu";
const TOLERANCE = cooking.planeTolerance;  // of faces that PhysX joins, metres
const material = physics.createMaterial(0.8, 0.8, 0.0);
const flags = new PhysX.PxShapeFlags(PhysX.PxShapeFlagEnum.eSIMULATION_SHAPE | PhysX.PxShapeFlagEnum.eSCENE_QUERY_SHAPE);
const filter = new PhysX.PxFilterData(1, 1, 0, 0);

function take(points) {
  const corners = new PhysX.PxArray_PxVec3(points.length);
  points.forEach(([x, y, z], i) => corners.set(i, new PhysX.PxVec3(x, y, z)));
  const described = new PhysX.PxConvexMeshDesc();
  described.flags = new PhysX.PxConvexFlags(PhysX.PxConvexFlagEnum.eCOMPUTE_CONVEX);
  described.points.count = points.length;
  described.points.stride = 12;
  described.points.data = corners.begin();
  const cook = (tolerance) => {
    cooking.planeTolerance = tolerance;
    const mesh = top.CreateConvexMesh(cooking, described);
    return mesh.ptr ? mesh : null;
  };
  const [shape, exact] = [cook(TOLERANCE), cook(0)];
  return { shape, gpu: Boolean(shape?.isGpuCompatible()), usual: kept(shape), ...kept(exact) };
}

function kept(mesh) {
  return mesh && { vertices: mesh.getNbVertices(), volume: cookedVolume(mesh) };
}

function cookedVolume(mesh) {
  const start = mesh.getVertices();
  const corner = (i) => at.getVec3At(start, i);
  const points = Array.from({ length: mesh.getNbVertices() }, (_, i) => [corner(i).x, corner(i).y, corner(i).z]);
  const indices = mesh.getIndexBuffer();
  const polygon = new PhysX.PxHullPolygon();
  const polygons = Array.from({ length: mesh.getNbPolygons() }, (_, i) => {
    mesh.getPolygonData(i, polygon);
    const first = polygon.mIndexBase;
    return Array.from({ length: polygon.mNbVerts }, (_, j) => at.getU8At(indices, first + j));
  });
  return volume(points, polygons);
}

function fall(shapes, starts, steps) {
  const described = new PhysX.PxSceneDesc(scale);
  described.gravity = new PhysX.PxVec3(0, 0, GRAVITY);
  described.cpuDispatcher = top.DefaultCpuDispatcherCreate(0);
  described.filterShader = top.DefaultFilterShader();
  const scene = physics.createScene(described);
  const upright = new PhysX.PxQuat(0, 0, 0, 1);
  const attach = (actor, geometry, local) => {
    const shape = physics.createShape(geometry, material, true, flags);
    shape.setSimulationFilterData(filter);
    if (local) shape.setLocalPose(local);
    actor.attachShape(shape);
  };
  const floor = physics.createRigidStatic(new PhysX.PxTransform(new PhysX.PxVec3(0, 0, -1), upright));
  attach(floor, new PhysX.PxBoxGeometry(20, 20, 1));
  scene.addActor(floor);
  const bodies = starts.map(([x, y, z]) => {
    const body = physics.createRigidDynamic(new PhysX.PxTransform(new PhysX.PxVec3(x, y, z), upright));
    for (const mesh of shapes) attach(body, new PhysX.PxConvexMeshGeometry(mesh));
    PhysX.PxRigidBodyExt.prototype.updateMassAndInertia(body, 1000);
    scene.addActor(body);
    return body;
  });
  for (let i = 0; i < steps; i++) {
    scene.simulate(STEP);
    scene.fetchResults(true);
  }
  return bodies.map((body) => {
    const { p, q } = body.getGlobalPose();
    const [v, w] = [body.getLinearVelocity(), body.getAngularVelocity()];
    return { pose: [p.x, p.y, p.z, q.x, q.y, q.z, q.w], velocity: [v.x, v.y, v.z, w.x, w.y, w.z] };
  });
}

run(`PhysX 5.6.1 (${NAME} ${version(NAME)})`, { take, fall });
