// The controls that decompose anew: what they hold is what `rlacd.decompose` is asked for.
import { choice, digits, make } from "page/widgets";

/** Lengths are shares of the longest side or of the frame; the slider moves by equal ratios. */
class Length {
  constructor(id, label, hint, [low, high], value, onChange) {
    this.low = low;
    this.ratio = high / low;
    this.slider = make("input", { type: "range", id, min: 0, max: 100, step: 1, "aria-label": label });
    this.box = make("input", { type: "number", min: 0, step: "any", id: `${id}-number`, "aria-label": `${label}, as a number` });
    this.note = make("small", {});
    this.value = value;
    this.#show();
    this.slider.addEventListener("input", () => {
      this.value = +(this.low * this.ratio ** (this.slider.value / 100)).toPrecision(2);
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
      { class: "length", title: hint },
      make("label", { for: id }, label),
      this.box,
      this.slider,
      this.note,
    );
  }

  #show({ slider = true } = {}) {
    const at = (100 * Math.log(this.value / this.low)) / Math.log(this.ratio);
    if (slider && Number.isFinite(at)) this.slider.value = at;
    this.box.value = this.value;
    this.slider.setAttribute("aria-valuetext", this.box.value);
    this.tell();
  }

  /** Say what the length is in the input's unit, `unit` of which are 1 here. */
  tell(unit = this.unit) {
    this.unit = unit;
    this.note.textContent = unit ? `${digits(this.value * unit)} in the file's unit` : "";
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
      "The concavity a hull may have, where the longest side of the mesh is 2. Smaller is tighter, with more hulls.",
      [0.01, 0.5],
      given.threshold,
      this.changed,
    );
    this.radius = new Length(
      "radius",
      "Ball radius",
      "The ball's radius, as a share of the longest side of the mesh.",
      [0.01, 0.3],
      given.radius,
      this.changed,
    );
    this.tolerance = new Length(
      "tolerance",
      "Tolerance",
      "Space nearer to the surface than this may be filled; a share of the longest side.",
      [0.005, 0.2],
      given.tolerance,
      this.changed,
    );
    this.criterion = choice(
      "Criterion",
      "criterion",
      [
        ["concavity", "Concavity", "A hull may lie so far from the surface, everywhere"],
        ["navigable", "Navigable space", "Hulls stay out of where a ball can go; what nobody reaches costs nothing"],
      ],
      given.criterion,
      (value) => {
        this.options.criterion = value;
        this.#arrange();
        this.changed();
      },
    );
    this.quality = choice(
      "Quality",
      "quality",
      [
        ["fast", "Fast", "One pass of cuts"],
        ["balanced", "Balanced", "Searches about a second for fewer hulls"],
        ["best", "Best", "Searches five seconds for fewer hulls"],
      ],
      given.quality,
      (value) => {
        this.options.quality = value;
        this.changed();
      },
    );
    this.hulls = this.#limit("max_hulls", "At most", "hulls", "The threshold may then be exceeded");
    this.corners = this.#limit("max_vertices", "At most", "vertices each", "64 for PhysX on a GPU");
    this.element = make(
      "section",
      { id: "controls", "aria-label": "Decompose" },
      this.criterion,
      this.threshold.element,
      this.radius.element,
      this.tolerance.element,
      this.quality,
      make("div", { class: "limits" }, this.hulls.element, this.corners.element),
    );
    this.#arrange();
  }

  values() {
    const { criterion, quality } = this.options;
    const size =
      criterion === "navigable"
        ? { radius: this.radius.value, tolerance: this.tolerance.value }
        : { threshold: this.threshold.value };
    return { ...size, criterion, quality, max_hulls: this.hulls.value(), max_vertices: this.corners.value() };
  }

  /** Make the threshold larger or smaller by a step, from the keyboard. */
  nudge(factor) {
    const length = this.options.criterion === "navigable" ? this.radius : this.threshold;
    length.box.value = +(length.value * factor).toPrecision(2);
    length.box.dispatchEvent(new Event("change"));
  }

  /** Lengths are also told in the input's unit; `scale` frame units are one of them. */
  setScale(scale) {
    this.threshold.tell(1 / scale);
    this.radius.tell(2 / scale);
    this.tolerance.tell(2 / scale);
  }

  #arrange() {
    const navigable = this.options.criterion === "navigable";
    this.threshold.element.hidden = navigable;
    this.radius.element.hidden = this.tolerance.element.hidden = !navigable;
  }

  #limit(id, before, after, hint) {
    const box = make("input", { type: "number", min: 1, id, placeholder: "any", value: this.options[id], onchange: this.changed });
    return {
      element: make("label", { title: hint }, before, box, after),
      value: () => (box.value === "" ? null : Number(box.value)),
    };
  }
}
