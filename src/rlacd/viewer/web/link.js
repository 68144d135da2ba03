// The viewer's server: what it is doing, what it has, and what it is asked for.

export class Link {
  /** `onState(state)` is called with every change; `onLost(why)` when there are no more: the server has gone, or
   * says why. */
  constructor({ onState, onLost }) {
    this.events = new EventSource("events");
    this.events.onmessage = (event) => onState(JSON.parse(event.data));
    this.events.onerror = async () => {
      const answer = await fetch("events").catch(() => null);
      const refused = answer && !answer.ok;
      const why = refused ? (await answer.json()).error : null;
      answer?.body?.cancel().catch(() => null);
      if (!answer || refused) onLost(why);
    };
  }

  scene = () => get("scene");

  heat = () => get("heat");

  decompose = (options) => post("decompose", options);

  command = (options) => post("command", options).then(({ command }) => command);

  touching = (values) => post("touching", { values }).then(({ contacts }) => contacts);

  /** Look at another mesh: a file of the user's. */
  async open(file) {
    const answer = await fetch(`open?${new URLSearchParams({ name: file.name })}`, {
      method: "POST",
      headers: { "Content-Type": "application/octet-stream" },
      body: file,
    });
    if (!answer.ok) throw new Error((await answer.json()).error);
  }

  cancel = () => post("cancel", {});

  /** A file's name and content. */
  async file(format, up) {
    const answer = await fetch(`download?${new URLSearchParams({ format, up })}`);
    if (!answer.ok) throw new Error((await answer.json()).error);
    const name = answer.headers.get("Content-Disposition").split("filename*=UTF-8''")[1];
    return { name: decodeURIComponent(name), content: await answer.blob() };
  }
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
