// The keyboard, and the page that tells of it.
import { make } from "page/widgets";

/** Bind `[key, what it does, action]`; typing in a field is left alone. */
export function bindKeys(bindings) {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target.matches?.("input[type=number], input[type=text], select, textarea");
    if (typing && event.key !== "Escape") return;
    const binding = bindings.find(([key]) => key.split(" ").includes(event.key) || key === event.key);
    if (!binding) return;
    if (event.target.closest?.("dialog[open]") && event.key !== "?") return;
    event.preventDefault();
    binding[2]();
  });
}

export function helpText(bindings) {
  const extra = [
    ["drag", "turn"],
    ["right drag", "move"],
    ["scroll", "zoom"],
    ["← ↑ → ↓", "turn, in the 3-D view; walk, in the list; change, on a slider"],
    ["click", "show one part alone; again, or beside it: all"],
    ["drop", "a file, anywhere: look at that mesh"],
  ];
  const rows = [...extra, ...bindings.filter(([, text]) => text)].map(([key, text]) =>
    make("tr", {}, make("td", {}, ...String(key).split(" ").flatMap((each, i) => [i ? " " : "", make("kbd", {}, each)])), make("td", {}, text)),
  );
  return make(
    "div",
    {},
    make("h2", {}, "Keyboard and mouse"),
    make("table", {}, make("tbody", {}, ...rows)),
    make("form", { method: "dialog" }, make("button", {}, "Close")),
  );
}
