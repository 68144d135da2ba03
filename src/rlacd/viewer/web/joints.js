// A robot's joints: a slider for each, where they put the links, and which links touch there.
import { make, measure } from "page/widgets";

const SETTLED = 60; // milliseconds without a change after which it is asked which links touch

/** Matrices of the joints: what each moves, from rest. An axis turns with the joints that carry it, so the motions of a
 * chain are multiplied (Brockett 1984). Lengths of joints that slide are `scale` units of the frame. */
export function jointMatrices({ joints }, values, scale) {
  const away = ({ leader, curve, rest }, i) =>
    leader < 0 ? values[i] - rest : curve.reduce((sum, factor, power) => sum + factor * away(joints[leader], leader) ** (power + 1), 0);
  const own = (joint, i) => {
    const [axis, anchor, by] = [new THREE.Vector3(...joint.axis), new THREE.Vector3(...joint.anchor), away(joint, i)];
    if (joint.slides) return new THREE.Matrix4().setPosition(axis.multiplyScalar(by * scale));
    const turn = new THREE.Matrix4().makeRotationAxis(axis, by);
    return turn.setPosition(anchor.clone().sub(anchor.clone().applyMatrix4(turn)));
  };
  const whole = (i) => (i < 0 ? new THREE.Matrix4() : whole(joints[i].parent).multiply(own(joints[i], i)));
  return joints.map((_, i) => whole(i));
}

export class Joints {
  /** `onMove(matrix of each link, whether far)` tells where links go, `onTouch(links)` which touch; `ask(values)` finds
   * the contacts at other places than the scene's, if anything can. */
  constructor({ onMove, onTouch, ask }) {
    Object.assign(this, { onMove, onTouch, ask });
    this.rows = make("div", { class: "joints" });
    this.place = make("select", { id: "place", "aria-label": "Joint positions", onchange: () => this.#go(this.scene.robot.places[this.place.value]) });
    this.said = make("p", { id: "contacts", role: "status" });
    this.element = make(
      "section",
      { id: "joints", "aria-label": "Joints", hidden: true },
      make("div", { class: "heading" }, make("h2", {}, "Joints"), make("button", { type: "button", id: "rest", "data-hint": "All joints as the file has them.", onclick: () => this.#rest() }, "Rest")),
      this.rows,
      this.place,
      this.said,
    );
  }

  /** Show another scene; the joints of the same robot stay where they are. */
  load(scene) {
    const { robot } = scene;
    const same = this.scene?.robot && JSON.stringify(this.scene.robot.joints) === JSON.stringify(robot?.joints);
    this.scene = scene;
    this.element.hidden = !robot;
    if (!robot) return;
    if (!same) this.values = robot.joints.slice(0, robot.free).map((joint) => joint.rest);
    this.sliders = robot.joints.slice(0, robot.free).map((joint, i) => this.#slider(joint, i));
    this.rows.replaceChildren(...this.sliders.map(({ row }) => row));
    if (!robot.free) this.rows.append(make("p", { class: "note" }, "No joint can be moved here."));
    this.place.replaceChildren(
      make("option", { value: "", disabled: true }, "Other positions"),
      ...robot.places.map(({ said }, i) => make("option", { value: i }, said)),
    );
    this.place.hidden = robot.places.length < 2;
    this.#moved();
  }

  #slider({ name, slides, lower, upper, rest }, i) {
    const [low, high] = [Math.min(lower, rest), Math.max(upper, rest)];
    const slider = make("input", { type: "range", min: low, max: high, step: (high - low) / 500, value: this.values[i], id: `joint-${i}` });
    const note = make("small", {});
    const show = () => {
      slider.value = this.values[i];
      note.textContent = slides ? measure(this.values[i] * this.scene.scale, this.scene) : `${Math.round((this.values[i] * 180) / Math.PI)}°`;
      slider.setAttribute("aria-valuetext", note.textContent);
    };
    slider.addEventListener("input", () => {
      this.values[i] = Number(slider.value);
      this.#moved();
    });
    return { show, row: make("div", { class: "length" }, make("label", { for: slider.id, title: name }, name), note, slider) };
  }

  #rest() {
    const { joints, free, places } = this.scene.robot;
    this.#go(places[0] ?? { values: joints.slice(0, free).map(({ rest }) => rest) });
  }

  #go({ values }) {
    this.values = [...values];
    this.#moved({ far: true });
  }

  #moved({ far = false } = {}) {
    const { robot, scale } = this.scene;
    for (const { show } of this.sliders) show();
    const matrices = jointMatrices(robot, this.values, scale);
    this.onMove(robot.links.map(({ joint }) => matrices[joint] ?? new THREE.Matrix4()), far);
    const known = robot.places.findIndex(({ values }) => values.every((value, i) => value === this.values[i]));
    this.place.value = known < 0 ? "" : known;
    clearTimeout(this.due);
    if (known >= 0) return this.#tell(robot.places[known].contacts);
    this.#tell(null);
    if (this.ask && robot.samples) this.due = setTimeout(() => this.#find(), SETTLED);
  }

  async #find() {
    const [scene, values] = [this.scene, [...this.values]];
    const contacts = await this.ask(values).catch(() => null);
    if (scene === this.scene && values.every((value, i) => value === this.values[i])) this.#tell(contacts);
  }

  /** Say which links touch; null if that is not known. */
  #tell(contacts) {
    const { robot } = this.scene;
    this.onTouch(new Set((contacts ?? []).flatMap(([first, second]) => [first, second])));
    const where = `${robot.samples.toLocaleString("en")} positions were looked at`;
    if (!robot.samples) this.said.textContent = "Whether links touch was not checked.";
    else if (contacts === null) this.said.textContent = this.ask ? "…" : `${where}; the list has the worst. What touches here is not known.`;
    else if (contacts.length === 0) this.said.textContent = "No links touch here, other than across a joint.";
    else this.said.replaceChildren(make("b", {}, "Links that touch, in red:"), ...contacts.map((each) => this.#contact(each)));
  }

  #contact([first, second, how]) {
    const [one, other] = [first, second].map((link) => this.scene.robot.links[link].name);
    return make("span", {}, `${one} and ${other}, ${how}`);
  }
}
