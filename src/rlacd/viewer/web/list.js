// The list of parts. Hovering highlights, clicking shows one part alone; arrow keys walk through it.
import { HINTS, capital, lengthOf } from "page/facts";
import { column, make } from "page/widgets";

/** What a part is called: by its link, if it is of a robot. */
export const partName = ({ link, primitive }, index, { robot }) =>
  `${robot ? robot.links[link].name : (primitive ?? "hull")} ${String(index).padStart(3, "0")}`;

export class PartList {
  constructor({ onHover, onPick }) {
    this.onHover = onHover;
    this.onPick = onPick;
    this.rows = [];
    this.body = make("tbody");
    this.order = { key: "index", down: false };
    this.head = make("tr");
    this.element = make(
      "div",
      { id: "parts", class: "scroll" },
      make("table", { "aria-label": "Parts" }, make("thead", {}, this.head), this.body),
    );
    this.body.addEventListener("pointerover", (event) => this.onHover(indexOf(event)));
    this.body.addEventListener("pointerleave", () => this.onHover(null));
    this.body.addEventListener("click", (event) => this.onPick(indexOf(event)));
    this.body.addEventListener("focusin", (event) => this.onHover(indexOf(event)));
    this.body.addEventListener("focusout", () => this.onHover(null));
    this.body.addEventListener("keydown", (event) => this.#key(event));
  }

  load(scene) {
    const navigable = Boolean(scene.report?.navigable);
    const all = scene.parts.reduce((sum, part) => sum + part.volume, 0) || 1;
    const volume = scene.report?.volume;
    const [criterion, length] = lengthOf(scene.report);
    this.asShare = Boolean(volume);
    this.limit = navigable ? null : (volume?.tolerance ?? length?.threshold);
    this.data = scene.parts.map((part, index) => ({
      index,
      name: scene.robot ? partName(part, index, scene) : String(index).padStart(3, "0"),
      color: part.color,
      faces: part.faces.length ? Math.round(atob(part.faces).length / 12) : 0,
      primitive: part.primitive,
      share: part.volume / all,
      error: part.error,
    }));
    this.columns = [
      ["index", "Part", "In the order of the file."],
      ["faces", "Faces", scene.report?.primitives ? "Triangles of the hull, or the primitive that the part is." : "Triangles of the hull."],
      ["share", "Volume", "Share of all hulls' volume."],
      volume ? ["error", "Added", `${HINTS.added} The bar is full at the tolerance.`] : navigable ? ["error", "Intrusion", HINTS.intrusion] : ["error", capital(criterion ?? "concavity"), `${HINTS.concavity} The bar is full at the threshold.`],
    ];
    this.head.replaceChildren(
      ...this.columns.map(([key, text, hint]) =>
        make("th", { scope: "col", "data-hint": hint }, make("button", { type: "button", onclick: () => this.#sort(key) }, text)),
      ),
    );
    this.#fill();
  }

  hover(index, { scroll = false } = {}) {
    for (const row of this.rows) row.classList.toggle("hover", row.number === index);
    const row = scroll && this.rows.find((each) => each.number === index);
    if (row) row.scrollIntoView({ block: "nearest" });
  }

  pick(index) {
    for (const row of this.rows) row.setAttribute("aria-selected", row.number === index);
  }

  #sort(key) {
    this.order = { key, down: this.order.key === key ? !this.order.down : key !== "index" };
    this.#fill();
  }

  #fill() {
    const { key, down } = this.order;
    const sign = down ? -1 : 1;
    const sorted = [...this.data].sort((a, b) => sign * ((a[key] ?? -1) - (b[key] ?? -1)) || a.index - b.index);
    [...this.head.children].forEach((cell, i) =>
      cell.setAttribute("aria-sort", this.columns[i][0] !== key ? "none" : down ? "descending" : "ascending"),
    );
    this.rows = sorted.map((part) => this.#row(part));
    this.rows.forEach((row, i) => (row.tabIndex = i === 0 ? 0 : -1));
    this.body.replaceChildren(...this.rows);
  }

  #row(part) {
    const swatch = make("i", { class: "swatch" });
    swatch.style.background = part.color;
    const over = this.limit != null && part.error > this.limit;
    const gauge = make("i", { class: over ? "gauge over" : "gauge" });
    gauge.style.width = `${Math.min(1, (part.error ?? 0) / (this.limit || Infinity)) * 100}%`;
    const row = make(
      "tr",
      { "aria-selected": "false", "data-part": part.index },
      make("td", { title: part.name }, swatch, part.name),
      make("td", {}, part.primitive ?? String(part.faces)),
      make("td", {}, `${column(100 * part.share)}\u00a0%`),
      make("td", { class: "error" }, part.error == null ? "–" : this.asShare ? `${column(100 * part.error)}\u00a0%` : column(part.error), this.limit ? make("span", { class: "track" }, gauge) : null),
    );
    row.number = part.index;
    return row;
  }

  #key(event) {
    const at = this.rows.indexOf(event.target.closest("tr"));
    const next = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: this.rows.length - 1 }[event.key];
    if (next !== undefined && this.rows[next]) {
      event.preventDefault();
      this.rows[at].tabIndex = -1;
      this.rows[next].tabIndex = 0;
      this.rows[next].focus();
    } else if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      this.onPick(indexOf(event));
    }
  }
}

const indexOf = (event) => event.target.closest("tr")?.number ?? null;
