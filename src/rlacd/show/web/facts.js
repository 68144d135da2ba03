// What the report says, in words and tables: fit, warnings, repair, times, options.
import { digits, make, plural } from "page/widgets";

const STEPS = {
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

/** One line: hulls, triangles, how tight, how long. */
export function summary({ report, parts }) {
  const faces = report.faces ?? parts.length;
  const words = [plural(parts.length, "hull"), plural(faces, "triangle")];
  if (report.concavity) words.push(`concavity ${digits(report.concavity.max)}`);
  if (report.navigable) words.push(`${plural(report.navigable.balls, "ball")} left free`);
  if (report.seconds?.total != null) words.push(`${report.seconds.total.toFixed(2)} s`);
  if (report.complete === false) words.push("stopped early");
  return words.join(" · ");
}

export function warnings(report) {
  return (report.warnings ?? []).map((text) => make("p", { class: "warning" }, text));
}

/** How well the hulls fit: lengths of the frame, and in the input's unit. */
export function fitTable(report) {
  const rows = [];
  const add = (name, value) => {
    if (value != null) rows.push([name, digits(value), digits(value / report.scale)]);
  };
  add("Largest concavity", report.concavity?.max);
  add("Deepest intrusion", report.navigable?.intrusion?.max);
  add("Hulls beyond the input", report.hausdorff?.over);
  add("Input beyond the hulls", report.hausdorff?.under);
  return table("Fit", ["", "longest side 2", "file's unit"], rows);
}

export function repairTable(report) {
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
    STEPS[step] ?? step,
    bodies.toLocaleString("en"),
    `${before.toLocaleString("en")} → ${after.toLocaleString("en")}`,
    moved < 1e-9 ? "0" : digits(moved / report.scale),
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
  value !== null && typeof value === "object"
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
  return make("section", { class: "facts" }, make("h2", {}, title), make("table", {}, head || null, make("tbody", {}, ...body)));
}
