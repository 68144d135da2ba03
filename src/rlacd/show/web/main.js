import { unpack } from "page/arrays";
import { Controls } from "page/controls";
import { fitTable, optionTable, repairTable, searchTable, stageName, summary, timeTable, warnings } from "page/facts";
import { bindKeys, helpText } from "page/keys";
import { Link } from "page/link";
import { PartList } from "page/list";
import { HEAT_COLORS, Stage } from "page/stage";
import { choice, digits, make, plural, toggle } from "page/widgets";

const at = (id) => document.getElementById(id);
const config = JSON.parse(at("config").textContent);
document.body.className = config.live ? "live" : "report";

let shown = null; // the scene on the stage
let run = null; // its number, with a server
let heatOf = null; // the scene the heat map belongs to
let picked = null;

// --- what is seen ---

const list = new PartList({ onHover: (index) => highlight(index), onPick: (index) => pick(index) });
let stage = null;
try {
  stage = new Stage(at("canvas"), {
    onHover: (index, x, y) => highlight(index, { scroll: true, x, y }),
    onPick: (index) => pick(index),
  });
} catch {
  say("This browser cannot show 3-D graphics (WebGL); turn on hardware or software rendering in its settings.");
}

function highlight(index, { scroll = false, x, y } = {}) {
  stage?.hover(index);
  list.hover(index, { scroll });
  const tip = at("tooltip");
  tip.hidden = index === null || x === undefined || !shown;
  if (tip.hidden) return;
  const part = shown.parts[index];
  tip.textContent = `hull ${String(index).padStart(3, "0")} · ${digits(part.error)}`;
  const frame = at("stage").getBoundingClientRect();
  tip.style.left = `${x - frame.left + 14}px`;
  tip.style.top = `${y - frame.top + 14}px`;
}

function pick(index) {
  picked = index === picked ? null : index;
  stage?.pick(picked);
  list.pick(picked);
}

function show(scene) {
  if (!shown) look.up.choose(scene.up, { silently: true });
  shown = scene;
  picked = null;
  heatOf = null;
  stage?.load(scene);
  list.load(scene);
  at("name").textContent = scene.name;
  at("summary").textContent = summary(scene);
  document.title = `${scene.name}: ${plural(scene.parts.length, "hull")}`;
  controls?.setScale(scene.report.scale);
  at("parts-count").textContent = scene.parts.length;
  const tables = [fitTable, repairTable, timeTable, searchTable, optionTable].map((table) => table(scene.report));
  const place = config.live ? at("details") : at("more");
  place.replaceChildren(...warnings(scene.report), ...picture(scene), make("div", { class: "tables" }, ...tables.filter(Boolean)));
  if (config.live) at("details").parentElement.querySelector("summary").dataset.warnings = plural(scene.report.warnings?.length ?? 0, "warning");
  look.balls.hidden = !scene.balls;
  for (const button of document.querySelectorAll("[data-format^=balls]")) button.hidden = !scene.balls;
  if (scene.balls) {
    const { shown: some, of } = scene.balls;
    look.balls.title = `${some < of ? `${some} of the ` : ""}${plural(of, "ball")} that no hull touches, none over another (B)`;
  } else look.balls.set(false);
  if (look.heat.getAttribute("aria-pressed") === "true") showHeat(true);
}

function picture({ picture: address, note }) {
  if (note) return [make("p", { class: "note" }, note)];
  return address ? [make("figure", {}, make("img", { src: address, alt: "The input, its hulls, and the hulls pulled apart" }))] : [];
}

async function showHeat(on) {
  stage?.set({ heat: on });
  const legend = at("legend");
  legend.hidden = true;
  if (!on || !shown) return;
  const scene = shown;
  try {
    if (heatOf !== scene) {
      const heat = scene.heat ?? (link && (await link.heat()));
      if (scene !== shown) return; // another decomposition has come meanwhile
      if (!heat || heat.parts.length === 0) return say("The input has no surface to measure to.");
      stage?.loadHeat(heat);
      heatOf = scene;
      legend.replaceChildren(...heatLegend(heat.max, scene.report.scale));
    }
    legend.hidden = look.heat.getAttribute("aria-pressed") !== "true";
  } catch (error) {
    say(error.message);
  }
}

function heatLegend(most, scale) {
  const bar = make("div", { class: "scale" });
  bar.style.background = `linear-gradient(to right, ${HEAT_COLORS.join(", ")})`;
  return [
    make("b", {}, "Hulls' surface to input"),
    bar,
    make("div", { class: "ends" }, make("span", {}, "0"), make("span", {}, digits(most))),
    make("small", {}, `longest side is 2; ${digits(most / scale)} in the file's unit. Grey: inner walls.`),
  ];
}

function say(text) {
  const trouble = at("trouble");
  trouble.textContent = text ?? "";
  trouble.hidden = !text;
}

// --- the toolbar ---

const explode = make("input", { type: "range", id: "explode", min: 0, max: 1.5, step: 0.01, value: 0, "aria-label": "Pull apart" });
explode.addEventListener("input", () => stage?.set({ pull: Number(explode.value) }));
explode.addEventListener("change", () => stage?.fit());
const body = [
  ["off", "Off", "Not shown"],
  ["ghost", "Ghost", "A shadow of it"],
  ["solid", "Solid", "As it is"],
];
const look = {
  input: choice("Input", "input-mode", body, "ghost", (mode) => stage?.set({ input: mode })),
  hulls: choice(
    "Hulls",
    "hulls-mode",
    [body[0], ["glass", "Glass", "The input shows through"], body[2]],
    "solid",
    (mode) => stage?.set({ hulls: mode }),
  ),
  up: choice(
    "Up",
    "up",
    ["x", "y", "z"].map((axis) => [axis, axis, `The input's ${axis} axis points up`]),
    null,
    (axis) => stage?.turn(axis),
  ),
  edges: toggle("edges", "Edges", true, "Edges of the hulls (E)", (on) => stage?.set({ edges: on })),
  heat: toggle("heat", "Error", false, "How far the hulls' surface lies from the input's (H)", showHeat),
  balls: toggle("balls", "Balls", false, "Balls that no hull touches (B)", (on) => stage?.set({ balls: on })),
};
at("toolbar").append(
  look.input,
  look.hulls,
  look.up,
  make("label", { class: "explode" }, make("span", {}, "Pull apart"), explode),
  make("span", { class: "toggles" }, look.edges, look.heat, look.balls),
  make("button", { type: "button", id: "fit", title: "Show all (F)", onclick: () => stage?.fit() }, "Fit"),
  make("button", { type: "button", id: "keys", title: "Keyboard and mouse (?)", "aria-label": "Keyboard and mouse", onclick: () => at("help").showModal() }, "?"),
);

// --- the panel ---

const controls = config.live ? new Controls(config, (options) => ask(options)) : null;
const downloads = config.live
  ? make(
      "section",
      { id: "download", "aria-label": "Download" },
      make("h2", {}, "Download"),
      make("div", { class: "buttons" }, ...config.downloads.map(([name, hint]) =>
        make("button", { type: "button", title: hint, "data-format": name, onclick: (event) => keep(name, event.target) }, name),
      )),
    )
  : null;
at("panel").append(
  ...[controls?.element].filter(Boolean),
  make("section", { id: "list" }, make("h2", {}, "Parts ", make("span", { id: "parts-count", class: "count" })), list.element),
  ...[downloads].filter(Boolean),
  ...(config.live ? [make("details", {}, make("summary", {}, "Fit, repair and times"), make("div", { id: "details" }))] : []),
);

// --- the server ---

const link = config.live ? new Link({ onState: follow, onLost: () => say("The viewer's server has stopped; start  rlacd view  again.") }) : null;
at("cancel").addEventListener("click", stop);

/** Download a file; some take seconds to make, which the button tells. */
async function keep(format, button) {
  say(null);
  button.setAttribute("aria-busy", true);
  try {
    const { name, content } = await link.file(format, look.up.querySelector("input:checked").value);
    const address = URL.createObjectURL(content);
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
  } catch (error) {
    say(error.message);
  }
  button.removeAttribute("aria-busy");
}

async function ask(options) {
  say(null);
  await link.decompose(options).catch((error) => say(error.message));
}

function stop() {
  link?.cancel().catch((error) => say(error.message));
}

async function follow(state) {
  const working = state.state === "working";
  at("progress").hidden = !working;
  document.body.classList.toggle("working", working);
  if (working) {
    const share = state.total ? state.done / state.total : null;
    const bar = at("progress").querySelector(".bar");
    bar.classList.toggle("unknown", share === null);
    bar.style.width = share === null ? "" : `${100 * Math.min(share, 1)}%`;
    const words = [stageName(state.stage), state.parts > 1 ? plural(state.parts, "part") : "", `${state.seconds.toFixed(1)} s`];
    at("progress").querySelector(".stage-name").textContent = words.filter(Boolean).join(" · ");
  } else if (state.error) say(state.error);
  if (!working && !state.error) say(null);
  if (state.run !== null && state.run !== run) {
    run = state.run;
    show(await link.scene().catch((error) => (say(error.message), shown)));
    document.body.dataset.run = run;
  }
}

// --- the keyboard ---

const step = (by) => {
  explode.value = Number(explode.value) + by;
  explode.dispatchEvent(new Event("input"));
  explode.dispatchEvent(new Event("change"));
};
const cycle = (bar) => {
  const inputs = [...bar.querySelectorAll("input")];
  bar.choose(inputs[(inputs.findIndex((input) => input.checked) + 1) % inputs.length].value);
};
const bindings = [
  ["I", "input: off, ghost, solid", () => cycle(look.input)],
  ["G", "hulls: off, glass, solid", () => cycle(look.hulls)],
  ["]", "pull apart", () => step(0.15)],
  ["[", "push together", () => step(-0.15)],
  ["E", "edges", () => look.edges.click()],
  ["H", "error heat map", () => look.heat.click()],
  ["B", "balls of the navigable space", () => look.balls.hidden || look.balls.click()],
  ["F", "show all", () => stage?.fit()],
  ...(config.live
    ? [
        ["-", "tighter: smaller threshold", () => controls.nudge(1 / 1.25)],
        ["+", "coarser: larger threshold", () => controls.nudge(1.25)],
      ]
    : []),
  ["Escape", "stop the work; show all parts", () => (document.body.classList.contains("working") ? stop() : pick(picked))],
  ["?", "this page", () => at("help").showModal()],
].flatMap(([key, text, action]) =>
  key.length === 1 && key !== key.toLowerCase() ? [[key, text, action], [key.toLowerCase(), "", action]] : [[key, text, action]],
);
bindKeys(bindings);
at("help").append(helpText(bindings));

if (!config.live) show(await unpack(at("data").textContent));
document.body.dataset.ready = "true";
