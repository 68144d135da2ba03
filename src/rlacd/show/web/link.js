// The viewer's server: what it is doing, what it has, and what it is asked for.

export class Link {
  /** `onState(state)` is called with every change; `onLost()` when the server has gone. */
  constructor({ onState, onLost }) {
    this.events = new EventSource("events");
    this.events.onmessage = (event) => onState(JSON.parse(event.data));
    this.events.onerror = () => onLost();
  }

  scene = () => get("scene");

  heat = () => get("heat");

  decompose = (options) => post("decompose", options);

  cancel = () => post("cancel", {});
}

async function get(name) {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error((await answer.json()).error);
  return answer.json();
}

async function post(name, value) {
  const answer = await fetch(name, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(value),
  });
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.error);
  return said;
}
