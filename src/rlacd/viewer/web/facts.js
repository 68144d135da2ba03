// What the report says, in words and tables: fit, warnings, repair, times, options.
import { term } from "page/hints";
import { digits, make, measure, plural } from "page/widgets";

const OUTCOMES = {
  closed: "Closed as it was",
  reoriented: "Faces turned outward",
  "outer skin": "Reduced to its outer skin",
  welded: "Cracks welded",
  capped: "Holes closed",
  slab: "Sheet made a thin slab",
  wrapped: "Wrapped as a whole",
  hull: "Replaced by its hull",
};

const STAGES = {
  load: "Read the file",
  repair: "Repair",
  space: "Find navigable space",
  cut: "Cut",
  merge: "Merge",
  search: "Search for fewer hulls",
  finish: "Finish",
  measure: "Measure",
};

export const stageName = (stage) => STAGES[stage] ?? stage;

export const HINTS = {
  hull: "A convex body: it has no dents. Physics engines collide these fast and reliably.",
  primitives: "Parts that are a box, a ball, a capsule or a cylinder, which models for simulators hold as such.",
  links: "Bodies that collide. The meshes of each become hulls as one solid.",
  kept: "Boxes, balls, capsules, cylinders and ellipsoids of the robot, in grey. They stay as they are.",
  triangles: "Of all hulls together. Fewer are faster to collide.",
  concavity:
    "The farthest that a part's surface and its hull's lie apart, anywhere: how much room the worst dent has that a hull fills. The longest side is 2, as for the threshold.",
  added: "The largest share of its part's volume that a hull adds.",
  intrusion: "How deep a hull reaches into the space that a ball can get to.",
  balls: "Places that a ball of the chosen radius can reach and no hull covers.",
  added: "The farthest that the hulls' surface lies outside the input's.",
  missed: "The farthest that the input's surface lies outside the hulls.",
  seconds: "Time for the whole decomposition, from reading the file to measuring the result.",
  draft: "The first hulls found, in one quick pass. A search for fewer hulls follows.",
  early: "The work was stopped. The hulls cover the input, but may be coarser or more than with more time.",
  shell:
    "An open surface has no inside, so it was given a small thickness. Its hulls follow that thin wall, which takes many of them. If it encloses a space, --openings solid fills it; in the viewer, “Solid” under “Open bodies”.",
  wrapped: "The surface could not be closed face by face, so a tight skin was wrapped around it.",
};

/** A criterion that is a length, by its name, with what it measured; nothing with others. */
export const lengthOf = (report) => Object.entries(report ?? {}).find(([, fit]) => fit?.per_part !== undefined && fit.threshold) ?? [];

export const capital = (word) => word[0].toUpperCase() + word.slice(1);

/** One line: hulls, triangles, how tight, how long; each with its explanation. */
export function summary(scene, { draft = false } = {}) {
  const { report, parts } = scene;
  if (!report) return [];
  const { volume, navigable, seconds } = report;
  const [criterion, length] = lengthOf(report);
  const words = [
    term(plural(parts.length, "hull"), HINTS.hull),
    report.primitives && term(plural(parts.filter((part) => part.primitive).length, "primitive"), HINTS.primitives),
    scene.kept.length > 0 && term(plural(scene.kept.length, "primitive"), HINTS.kept),
    scene.robot && term(plural(scene.robot.links.length, "link"), HINTS.links),
    term(plural(report.triangles ?? parts.length, "triangle"), HINTS.triangles),
    length && term(`${criterion} at most\u00a0${digits(length.max)}`, HINTS.concavity),
    volume?.max != null && term(`${percent(volume.max)} of volume added`, HINTS.added),
    navigable && term(`${plural(navigable.balls, "ball")} left free`, HINTS.balls),
    !draft && seconds?.total != null && term(`${seconds.total.toFixed(2)}\u00a0s`, HINTS.seconds),
    draft && term("first pass", HINTS.draft),
    report.complete === false && term("stopped early", HINTS.early),
  ].filter(Boolean);
  return words.flatMap((word, i) => (i ? [" · ", word] : [word]));
}

const repaired = (report, ...steps) => (report?.repair ?? []).filter(({ step }) => steps.includes(step)).length;

/** Whether repair had to decide what is inside. */
export const hasOpenBodies = ({ report }) => repaired(report, "slab", "wrapped", "capped") > 0;

/** Whether repair filled cavities and said so. */
export const hasFilledCavities = ({ report }) => (report?.warnings ?? []).some((text) => text.includes("keep_cavities"));

/** What repair made of open bodies, in a sentence, with its explanation. */
export function notes({ report }) {
  const [shells, wrapped] = [repaired(report, "slab"), repaired(report, "wrapped")];
  const bodies = (n) => (n === 1 ? "1 open body" : `${n.toLocaleString("en")} open bodies`);
  return [
    shells && term(`${bodies(shells)} became ${shells === 1 ? "a thin shell" : "thin shells"}`, HINTS.shell),
    wrapped && term(`${bodies(wrapped)} ${wrapped === 1 ? "was" : "were"} wrapped`, HINTS.wrapped),
  ].filter(Boolean).flatMap((word, i) => (i ? [" · ", word] : [word]));
}

const percent = (share) => `${digits(100 * share, 2)}\u00a0%`;

export function warnings(report) {
  return (report.warnings ?? []).map((text) => make("p", { class: "warning" }, text));
}

/** How well the hulls fit: lengths in the scene's unit, and as shares of its longest side. */
export function fitTable(report, scene) {
  const rows = [];
  const add = (name, value, hint) => {
    if (value != null) rows.push([term(name, hint), measure(value, scene), `${digits(50 * value, 2)}\u00a0%`]);
  };
  const [criterion, length] = lengthOf(report);
  if (length) add(`${capital(criterion)}, at most`, length.max, HINTS.concavity);
  if (report.volume?.max != null) rows.push([term("Largest added volume", HINTS.added), percent(report.volume.max), ""]);
  add("Deepest intrusion", report.navigable?.intrusion?.max, HINTS.intrusion);
  add("Hulls beyond the input", report.hausdorff?.added, HINTS.added);
  add("Input beyond the hulls", report.hausdorff?.missed, HINTS.missed);
  return table("Fit", ["", "", "of its size"], rows);
}

export function repairTable(report, scene) {
  const groups = new Map();
  for (const { step, faces_in, faces_out, deviation } of report.repair ?? []) {
    const group = groups.get(step) ?? { bodies: 0, before: 0, after: 0, moved: 0 };
    group.bodies += 1;
    group.before += faces_in;
    group.after += faces_out;
    group.moved = Math.max(group.moved, deviation ?? 0);
    groups.set(step, group);
  }
  const rows = [...groups].map(([step, { bodies, before, after, moved }]) => [
    OUTCOMES[step] ?? step,
    bodies.toLocaleString("en"),
    `${before.toLocaleString("en")} → ${after.toLocaleString("en")}`,
    moved < 1e-9 ? "0" : measure(moved, scene),
  ]);
  return table("Repair", ["", "bodies", "faces", "moved"], rows);
}

export function timeTable(report) {
  const { total, ...stages } = report.seconds ?? {};
  const rows = Object.entries(stages).map(([stage, seconds]) => [stageName(stage), seconds.toFixed(3)]);
  if (total != null) rows.push(["Total", total.toFixed(3)]);
  return table("Time", ["", "seconds"], rows);
}

export function searchTable({ search }) {
  if (!search) return table("Search", [], []);
  return table("Search", ["", ""], Object.entries(search).map(([name, value]) => [words(name), plain(value)]));
}

export function optionTable({ options = {}, version }) {
  const given = Object.entries(options).filter(([, value]) => value != null);
  return table("Options", ["", ""], [...given.map(([name, value]) => [words(name), plain(value)]), ["rlacd", version ?? "–"]]);
}

const words = (name) => name.replaceAll("_", " ");
const plain = (value) =>
  Array.isArray(value) && value.length === 0 ? "none"
  : value !== null && typeof value === "object"
    ? Object.entries(value).filter(([, each]) => each != null).map(([name, each]) => `${words(name)} ${plain(each)}`).join(", ")
    : typeof value === "number"
      ? digits(value, 4)
      : String(value ?? "–");

function table(title, heads, rows) {
  if (rows.length === 0) return null;
  const head = heads.some(Boolean) && make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text))));
  const body = rows.map(([name, ...cells]) =>
    make("tr", {}, make("th", { scope: "row" }, name), ...cells.map((text) => make("td", {}, text))),
  );
  return make("section", { class: heads.some(Boolean) ? "facts" : "facts long" }, make("h2", {}, title), make("table", {}, head || null, make("tbody", {}, ...body)));
}
