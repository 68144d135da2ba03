import { unpack } from "page/arrays";
import { Controls } from "page/controls";
import { fitTable, notes, optionTable, repairTable, searchTable, stageName, summary, timeTable, warnings } from "page/facts";
import { roundLength } from "page/ground";
import { showHints } from "page/hints";
import { Joints } from "page/joints";
import { bindKeys, helpText } from "page/keys";
import { Link } from "page/link";
import { PartList, partName } from "page/list";
import { HEAT_COLORS, Stage } from "page/stage";
import { choice, make, measure, plural, toggle } from "page/widgets";

const at = (id) => document.getElementById(id);
const config = JSON.parse(at("config").textContent);
document.body.className = config.live ? "live" : "report";

let shown = null; // the scene on the stage
let version = null; // its number, with a server
let loading = null; // what will be shown, once it is here
let heatOf = null; // the scene the heat map belongs to
let picked = null;

// --- what is seen ---

const joints = new Joints({
  onMove: (matrices, far) => {
    stage?.move(matrices);
    if (far) stage?.fit();
  },
  onTouch: (links) => stage?.touch(links),
  ask: config.live ? (values) => link.touching(values) : null,
});
const list = new PartList({ onHover: (index) => highlight(index), onPick: (index) => pick(index) });
let stage = null;
try {
  stage = new Stage(at("canvas"), {
    onHover: (index, x, y) => highlight(index, { scroll: true, x, y }),
    onPick: (index) => pick(index),
    onView: (pixels) => measureView(pixels),
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
  tip.textContent = `${partName(part, index, shown)}${part.error == null ? "" : ` · ${measure(part.error, shown)}`}`;
  const frame = at("stage").getBoundingClientRect();
  tip.style.left = `${x - frame.left + 14}px`;
  tip.style.top = `${y - frame.top + 14}px`;
}

function pick(index) {
  picked = index === picked ? null : index;
  stage?.pick(picked);
  list.pick(picked);
}

function show(scene, { draft = false } = {}) {
  const other = !shown || shown.name !== scene.name || shown.up !== scene.up || !scene.report;
  if (other) look.up.choose(scene.up, { silently: true });
  tellUp(scene.upIsGuess);
  shown = scene;
  picked = null;
  heatOf = null;
  stage?.load(scene, { frame: other });
  list.load(scene);
  joints.load(scene);
  at("name").textContent = scene.name;
  at("summary").replaceChildren(...summary(scene, { draft }));
  at("notes").replaceChildren(...notes(scene));
  at("notes").hidden = at("notes").childNodes.length === 0;
  document.title = scene.report ? `${scene.name}: ${plural(scene.parts.length, "hull")}` : scene.name;
  controls?.setScene(scene);
  at("parts-count").textContent = scene.report ? scene.parts.length : "";
  document.body.classList.toggle("bare", !scene.report);
  document.body.classList.toggle("robot", Boolean(scene.robot));
  if (scene.report) tell(scene);
  look.balls.hidden = !scene.balls;
  for (const button of document.querySelectorAll("[data-format^=balls]")) button.hidden = !scene.balls;
  if (scene.balls) {
    const { shown: some, of } = scene.balls;
    look.balls.dataset.hint = `${some < of ? `${some} of the ` : ""}${plural(of, "ball")} that no hull touches, none over another (B).`;
  } else look.balls.set(false);
  if (look.heat.getAttribute("aria-pressed") === "true") showHeat(true);
}

/** Formats such as OBJ do not say which axis points up. */
function tellUp(isGuess) {
  const legend = look.up.querySelector("legend");
  legend.textContent = isGuess ? "Up (a guess)" : "Up";
  legend.classList.toggle("term", Boolean(isGuess));
  if (isGuess) legend.dataset.hint = "The file does not say which axis points up: y if the mesh stands on y = 0 and not on z = 0, else z.";
  else delete legend.dataset.hint;
}

function tell(scene) {
  const tables = [fitTable, repairTable, timeTable, searchTable, optionTable].map((table) => table(scene.report, scene));
  const place = config.live ? at("details") : at("more");
  place.replaceChildren(...warnings(scene.report), ...picture(scene), make("div", { class: "tables" }, ...tables.filter(Boolean)));
  if (config.live) at("details").parentElement.querySelector("summary").dataset.warnings = plural(scene.report.warnings?.length ?? 0, "warning");
}

/** Keep the scale bar true: `pixels` are a frame unit in the middle of the view. */
function measureView(pixels) {
  const bar = at("scalebar");
  bar.hidden = !shown;
  if (!shown) return;
  const unit = pixels * shown.unit.length; // pixels to a unit
  const length = roundLength(140 / unit);
  bar.querySelector("i").style.width = `${length * unit}px`;
  bar.querySelector("span").textContent = measure(length * shown.unit.length, shown);
}

function picture({ picture: address, note }) {
  if (note) return [make("p", { class: "note" }, note)];
  return address ? [make("figure", {}, make("img", { src: address, alt: "The input, its hulls, and the hulls pulled apart" }))] : [];
}

async function showHeat(on) {
  stage?.set({ heat: on });
  const legend = at("legend");
  legend.hidden = true;
  if (!on || !shown?.report) return;
  const scene = shown;
  try {
    if (heatOf !== scene) {
      const heat = scene.heat ?? (link && (await link.heat()));
      if (scene !== shown) return; // another decomposition has come meanwhile
      if (!heat || heat.parts.length === 0) return say("The input has no surface to measure to.");
      stage?.loadHeat(heat);
      heatOf = scene;
      legend.replaceChildren(...heatLegend(heat.max, scene));
    }
    legend.hidden = look.heat.getAttribute("aria-pressed") !== "true";
  } catch (error) {
    say(error.message);
  }
}

function heatLegend(most, scene) {
  const bar = make("div", { class: "scale" });
  bar.style.background = `linear-gradient(to right, ${HEAT_COLORS.join(", ")})`;
  return [
    make("b", {}, "From the hulls to the input"),
    bar,
    make("div", { class: "ends" }, make("span", {}, "0"), make("span", {}, measure(most, scene))),
    make("small", {}, "Grey: where hulls touch each other, which is no error."),
  ];
}

function say(text) {
  const trouble = at("trouble");
  trouble.textContent = text ?? "";
  trouble.hidden = !text;
}

// --- the toolbar ---

const explode = make("input", { type: "range", id: "explode", min: 0, max: 1.5, step: 0.01, value: 0, "aria-label": "Pull apart" });
explode.addEventListener("input", () => {
  stage?.set({ pull: Number(explode.value) });
  stage?.fit();
});
const body = [
  ["off", "Off", "Not shown."],
  ["ghost", "Ghost", "A shadow around the hulls."],
  ["solid", "Solid", "As it is."],
];
const look = {
  input: choice("Input", "input-mode", body, "ghost", (mode) => stage?.set({ input: mode })),
  hulls: choice(
    "Hulls",
    "hulls-mode",
    [body[0], ["glass", "Glass", "The input shows through."], body[2]],
    "solid",
    (mode) => stage?.set({ hulls: mode }),
  ),
  up: choice(
    "Up",
    "up",
    ["x", "y", "z"].map((axis) => [axis, axis, `The input's ${axis} axis points up.`]),
    null,
    (axis) => stage?.turn(axis),
  ),
  edges: toggle("edges", "Edges", true, "Edges of the hulls (E).", (on) => stage?.set({ edges: on })),
  heat: toggle("heat", "Error", false, "Colours tell how far the hulls' surface lies from the input's (H).", showHeat),
  balls: toggle("balls", "Balls", false, "Balls that no hull touches (B).", (on) => stage?.set({ balls: on })),
  grid: toggle("grid", "Grid", true, "The ground, in cells of a round length (R).", (on) => stage?.set({ grid: on })),
};
at("toolbar").append(
  look.input,
  look.hulls,
  look.up,
  make("label", { class: "explode", "data-hint": "Move the hulls away from each other, to see between them ([ and ])." }, make("span", {}, "Pull apart"), explode),
  make("span", { class: "toggles" }, look.edges, look.grid, look.heat, look.balls),
  make("button", { type: "button", id: "fit", "data-hint": "Show all (F).", onclick: () => stage?.fit() }, "Fit"),
  make("button", { type: "button", id: "keys", "data-hint": "Keyboard and mouse (?).", "aria-label": "Keyboard and mouse", onclick: () => at("help").showModal() }, "?"),
);

// --- the panel ---

const controls = config.live ? new Controls(config, (options) => ask(options)) : null;
const downloads = config.live ? downloadSection() : null;

/** Presets of engines, then the files by kind; what cannot be made here is disabled and says why. */
function downloadSection() {
  const groups = new Map();
  for (const offer of config.downloads) groups.set(offer.group, [...(groups.get(offer.group) ?? []), offer]);
  const preset = make(
    "select",
    { id: "preset", onchange: (event) => choosePreset(event.target.value) },
    make("option", { value: "" }, "any engine"),
    ...config.presets.map(({ name, engine }) => make("option", { value: name, selected: name === config.options.preset }, engine)),
  );
  const note = make("small", { id: "preset-note" });
  const rows = [...groups].map(([group, offers]) =>
    make("div", { class: "row", "data-group": group }, make("h3", {}, group), make("div", { class: "buttons" }, ...offers.map(downloadButton))),
  );
  return make(
    "section",
    { id: "download", "aria-label": "Download" },
    make(
      "div",
      { class: "heading" },
      make("h2", {}, "Download"),
      make("label", { class: "preset", "data-hint": "Keep to an engine's limits on hulls, and point out its format." }, "for ", preset),
    ),
    note,
    ...rows,
    make("button", { type: "button", id: "copy", "data-hint": "The same decomposition as a command for a terminal.", onclick: copyCommand }, "Copy as command"),
  );
}

function downloadButton({ name, label, hint, missing }) {
  return make(
    "button",
    {
      type: "button",
      "data-hint": missing ? `${hint} ${missing}` : hint,
      "data-format": name,
      "aria-disabled": missing ? "true" : null,
      onclick: (event) => (missing ? say(missing) : keep(name, event.target)),
    },
    label,
    missing ? make("small", {}, "needs an extra") : null,
  );
}

function choosePreset(name) {
  const preset = config.presets.find((each) => each.name === name);
  for (const button of document.querySelectorAll("[data-format]")) button.classList.toggle("suited", button.dataset.format === preset?.format);
  at("preset-note").textContent = preset?.limits ? `At most ${preset.limits} per hull.` : "";
  if ((controls.options.preset ?? "") !== name) controls.setPreset(name || null);
}

async function copyCommand() {
  try {
    const command = await link.command(controls.values());
    await navigator.clipboard.writeText(command);
    at("copy").textContent = "Copied";
  } catch (error) {
    return say(error.message);
  }
  setTimeout(() => (at("copy").textContent = "Copy as command"), 1600);
}

at("panel").append(
  joints.element,
  ...[controls?.element].filter(Boolean),
  make("section", { id: "list" }, make("h2", {}, "Parts ", make("span", { id: "parts-count", class: "count" })), list.element),
  ...[downloads].filter(Boolean),
  ...(config.live ? [make("details", {}, make("summary", {}, "Fit, repair and times"), make("div", { id: "details" }))] : []),
);

// --- the server ---

const link = config.live
  ? new Link({ onState: follow, onLost: (why) => say(why ?? "The viewer's server has stopped; start  rlacd view  again.") })
  : null;
if (config.live) choosePreset(config.options.preset ?? "");
at("cancel").addEventListener("click", stop);

/** Download a file; the button tells how long it is being made: a report takes a minute. */
async function keep(format, button) {
  say(null);
  button.setAttribute("aria-busy", true);
  const [spent, began] = [make("small", {}), Date.now()];
  button.append(spent);
  const clock = setInterval(() => (spent.textContent = `${Math.round((Date.now() - began) / 1000)} s`), 1000);
  try {
    const { name, content } = await link.file(format, look.up.querySelector("input:checked").value);
    const address = URL.createObjectURL(content);
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
  } catch (error) {
    say(error.message);
  }
  clearInterval(clock);
  spent.remove();
  button.removeAttribute("aria-busy");
}

let refused = false; // whether the server keeps other options than the page shows

async function ask(options) {
  say(null);
  refused = false;
  await link.decompose(options).catch((error) => {
    refused = true;
    say(error.message);
  });
}

/** Look at a file of the user's. */
async function open(file) {
  if (!file) return;
  say(null);
  at("summary").textContent = `Reading ${file.name} …`;
  try {
    await link.open(file);
  } catch (error) {
    at("summary").replaceChildren(...summary(shown));
    return say(error.message);
  }
  if (refused) await ask(controls.values()); // says again why
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
  if (state.version !== version) {
    version = state.version;
    loading = link.scene().then(
      (scene) => version === state.version && show(scene, { draft: state.draft }),
      (error) => say(error.message),
    );
  }
  await loading;
  if (!working && state.run !== null && version === state.version) document.body.dataset.run = state.run;
}

// --- another file ---

if (config.live) {
  const picker = make("input", { type: "file", id: "file", hidden: true, accept: config.formats.map((ending) => `.${ending}`).join(",") });
  picker.addEventListener("change", () => open(picker.files[0]).then(() => (picker.value = "")));
  document.body.append(picker);
  at("open").hidden = false;
  at("open").addEventListener("click", () => picker.click());
  let within = 0; // elements that the file is over
  const hover = (by) => (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    within = Math.max(0, within + by);
    at("drop").hidden = within === 0;
  };
  addEventListener("dragenter", hover(1));
  addEventListener("dragleave", hover(-1));
  addEventListener("dragover", hover(0));
  addEventListener("drop", (event) => {
    event.preventDefault();
    within = 0;
    at("drop").hidden = true;
    open(event.dataTransfer.files[0]);
  });
}

// --- the keyboard ---

const step = (by) => {
  explode.value = Number(explode.value) + by;
  explode.dispatchEvent(new Event("input"));
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
  ["R", "ground grid", () => look.grid.click()],
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
showHints(document.body);
at("help").append(helpText(bindings));

if (!config.live) show(await unpack(at("data").textContent));
document.body.dataset.ready = "true";
