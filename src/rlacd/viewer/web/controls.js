// The controls that decompose anew: what they hold is what `rlacd.decompose` is asked for.
import { hasFilledCavities, hasOpenBodies } from "page/facts";
import { choice, make, measure } from "page/widgets";

/** Lengths are in the frame, where the longest side is 2; the slider moves by equal ratios. */
class Length {
  constructor(id, label, hint, [low, high], value, onChange, { orNone = false } = {}) {
    this.low = low;
    this.ratio = high / low;
    this.slider = make("input", { type: "range", id, min: 0, max: 100, step: 1, "aria-label": label });
    this.box = make("input", { type: "number", min: 0, step: "any", id: `${id}-number`, "aria-label": `${label}, as a number` });
    this.note = make("small", {});
    this.value = value;
    this.#show();
    this.slider.addEventListener("input", () => {
      const none = orNone && this.slider.value === "0";
      this.value = none ? 0 : +(this.low * this.ratio ** (this.slider.value / 100)).toPrecision(2);
      this.#show({ slider: false });
    });
    this.slider.addEventListener("change", () => onChange());
    this.box.addEventListener("change", () => {
      if (this.box.value === "") return this.#show();
      this.value = Number(this.box.value);
      this.#show();
      onChange();
    });
    this.element = make(
      "div",
      { class: "length" },
      make("label", { for: id }, make("span", { class: "term", "data-hint": hint }, label)),
      this.note,
      this.box,
      this.slider,
    );
  }

  #show({ slider = true } = {}) {
    const at = this.value === 0 ? 0 : (100 * Math.log(this.value / this.low)) / Math.log(this.ratio);
    if (slider && Number.isFinite(at)) this.slider.value = at;
    this.box.value = this.value;
    this.slider.setAttribute("aria-valuetext", this.box.value);
    this.tell();
  }

  /** Say what the length is in the input's unit. */
  tell(scene = this.scene) {
    this.scene = scene;
    this.note.textContent = !scene ? "" : this.value === 0 ? "none" : `= ${measure(this.value, scene)}`;
  }
}

export class Controls {
  /** `onChange(options)` is called when the user settles on other options. */
  constructor(config, onChange) {
    const given = config.options;
    this.options = { ...given };
    this.changed = () => onChange(this.values());
    this.threshold = new Length(
      "threshold",
      "Threshold",
      "How far a hull may lie from the surface, at the worst place. 0.05 is 2.5% of the longest side, which counts as 2. Smaller is tighter, with more hulls.",
      [0.01, 0.5],
      given.threshold,
      this.changed,
    );
    this.radius = new Length(
      "radius",
      "Ball radius",
      "The radius of the smallest ball that has to fit in between. 0.05 is 2.5% of the longest side, which counts as 2.",
      [0.02, 0.6],
      given.radius,
      this.changed,
    );
    this.tolerance = new Length(
      "tolerance",
      "Tolerance",
      "Space nearer to the surface than this may be filled. 0.1 is 5% of the longest side, which counts as 2.",
      [0.01, 0.4],
      given.tolerance,
      this.changed,
    );
    this.volume = new Length(
      "volume_tolerance",
      "Added volume",
      "The share of its part's volume that a hull may add: 0.01 is 1%.",
      [0.001, 1],
      given.volume_tolerance,
      this.changed,
    );
    this.volume.tell = () => {}; // a share, not a length
    this.criterion = choice(
      "Criterion",
      "criterion",
      [
        ["concavity", "Concavity", "Every hull stays within the threshold of the surface, everywhere, and adds little volume: CoACD's measure."],
        ["distance", "Distance", "Every hull stays within the threshold of the surface, everywhere."],
        ["volume", "Volume", "Every hull adds at most a share of volume, as V-HACD and NavACD measure it."],
        ["navigable", "Navigable", "Hulls stay out of where a ball can go. Dents too narrow for the ball are filled, which saves hulls."],
      ],
      given.criterion,
      (value) => {
        this.options.criterion = value;
        this.#arrange();
        this.changed();
      },
      "When a hull is tight enough.",
    );
    this.quality = choice(
      "Quality",
      "quality",
      [
        ["fast", "Fast", "One pass of cuts: a fraction of a second for most meshes."],
        ["balanced", "Balanced", "A pass, then a short search for fewer hulls."],
        ["best", "Best", "A pass, then five seconds or more of search for fewer hulls."],
      ],
      given.quality,
      (value) => {
        this.options.quality = value;
        this.changed();
      },
      "How long to search for a decomposition with fewer hulls. Never looser than the threshold.",
    );
    this.shapes = choice(
      "Shapes",
      "shapes",
      [
        ["hulls", "Hulls", "Every part is a convex hull."],
        ["primitives", "Primitives", "A box, ball, capsule or cylinder where one is tight enough, else a hull. Models for simulators hold them as such: fewer bytes, faster contacts."],
      ],
      given.primitives === true || given.primitives?.length ? "primitives" : "hulls",
      (value) => {
        this.options.primitives = value === "primitives";
        this.changed();
      },
      "What the parts become.",
    );
    this.overlap = new Length(
      "overlap",
      "Overlap",
      "How deep hulls that touch reach into each other, so that nothing thin slips between them. 0.05 is 2.5% of the longest side, which counts as 2.",
      [0.002, 0.2],
      given.overlap,
      this.changed,
      { orNone: true },
    );
    this.passages = choice(
      "Passages",
      "passages",
      [
        ["close", "May close", "The criterion alone decides what becomes of holes and slots."],
        ["open", "Stay open", "Of a ball that fits in a hole, slot or mouth and is no smaller than the threshold, nine tenths still fit between the hulls."],
      ],
      given.keep_open ? "open" : "close",
      (value) => {
        this.options.keep_open = value === "open" ? given.keep_open ?? 0.9 : null;
        this.changed();
      },
      "What becomes of holes, slots and mouths.",
    );
    this.open = choice(
      "Open bodies",
      "openings",
      [
        ["auto", "Auto", "Fill bodies that nothing can get into, or that have lost some faces; the others become thin shells."],
        ["small", "Small", "Also fill those whose openings are small beside them, as links of robots are."],
        ["solid", "Solid", "Fill every body that encloses a space once its openings are closed."],
        ["thin", "Thin", "Fill none: every open body becomes a thin shell."],
      ],
      given.openings,
      (value) => {
        this.options.openings = value;
        this.changed();
      },
      "What becomes of bodies with openings.",
    );
    this.cavities = choice(
      "Closed cavities",
      "cavities",
      [
        ["fill", "Fill", "Nothing can get in, so hulls may fill them. The mass leaves them out."],
        ["keep", "Keep", "What is closed stays empty: a room to stand in, a ball that starts inside."],
      ],
      given.keep_cavities ? "keep" : "fill",
      (value) => {
        this.options.keep_cavities = value === "keep";
        this.changed();
      },
      "What becomes of space that walls enclose.",
    );
    this.hulls = this.#limit("max_hulls", "Hulls, at most", "No more hulls than this. The threshold may then be exceeded.");
    this.corners = this.#limit("max_vertices", "Vertices each", "Corners that each hull may have. Engines have limits, and every corner costs time in a contact.");
    this.element = make(
      "section",
      { id: "controls", "aria-label": "Decompose" },
      this.criterion,
      this.threshold.element,
      this.radius.element,
      this.tolerance.element,
      this.volume.element,
      this.quality,
      this.shapes,
      this.overlap.element,
      this.passages,
      this.open,
      this.cavities,
      make("div", { class: "limits" }, this.hulls.element, this.corners.element),
    );
    this.#arrange();
  }

  values() {
    const { criterion, quality } = this.options;
    const size =
      criterion === "navigable"
        ? { radius: this.radius.value, tolerance: this.tolerance.value }
        : criterion === "volume"
        ? { volume_tolerance: this.volume.value }
        : { threshold: this.threshold.value };
    const limits = { max_hulls: this.hulls.value(), max_vertices: this.corners.value(), preset: this.options.preset ?? null };
    return { ...size, criterion, quality, primitives: this.options.primitives, overlap: this.overlap.value, keep_open: this.options.keep_open ?? null, openings: this.options.openings, keep_cavities: this.options.keep_cavities && criterion !== "navigable", ...limits };
  }

  /** Take another engine's limits. */
  setPreset(preset) {
    this.options.preset = preset;
    this.changed();
  }

  /** Make the threshold larger or smaller by a step, from the keyboard. */
  nudge(factor) {
    const length = { navigable: this.radius, volume: this.volume }[this.options.criterion] ?? this.threshold;
    length.box.value = +(length.value * factor).toPrecision(2);
    length.box.dispatchEvent(new Event("change"));
  }

  /** Lengths are also told in the unit of what is shown; only what has open bodies or cavities offers a choice about them. */
  setScene(scene) {
    for (const length of [this.threshold, this.radius, this.tolerance, this.overlap]) length.tell(scene);
    this.criterion.querySelector("input[value=navigable]").disabled = Boolean(scene.robot); // a ball has one size for all
    this.open.hidden = this.options.openings === "auto" && !hasOpenBodies(scene);
    this.cavities.hidden = this.options.criterion === "navigable" || !(this.options.keep_cavities || hasFilledCavities(scene));
  }

  #arrange() {
    const { criterion } = this.options;
    const navigable = criterion === "navigable";
    this.threshold.element.hidden = criterion === "navigable" || criterion === "volume";
    this.volume.element.hidden = criterion !== "volume";
    this.radius.element.hidden = this.tolerance.element.hidden = !navigable;
  }

  #limit(id, label, hint) {
    const box = make("input", { type: "number", min: 1, id, placeholder: "any", value: this.options[id], onchange: this.changed });
    return {
      element: make("label", {}, make("span", { class: "term", "data-hint": hint }, label), box),
      value: () => (box.value === "" ? null : Number(box.value)),
    };
  }
}
