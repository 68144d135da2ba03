// Small pieces of the page. Text always goes in as text, never as markup: names come from files of strangers.

/** An element with attributes, listeners (`onclick: ...`) and children (nodes or text). */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.startsWith("aria-")) element.setAttribute(name, value); // "true" and "false" are words there
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child != null));
  return element;
}

/** One of several choices, as radio buttons that look like one bar; arrow keys move in it. */
export function choice(label, name, options, chosen, onChange, explained = null) {
  const buttons = options.map(([value, text, hint]) =>
    make(
      "label",
      { "data-hint": hint },
      make("input", { type: "radio", name, value, checked: value === chosen, onchange: () => onChange(value) }),
      make("span", {}, text),
    ),
  );
  const bar = make("fieldset", { class: "choice", id: name }, make("legend", explained ? { class: "term", "data-hint": explained } : {}, label), ...buttons);
  bar.choose = (value, { silently = false } = {}) => {
    const input = bar.querySelector(`input[value="${value}"]`);
    if (input && !input.disabled && !input.checked) {
      input.checked = true;
      if (!silently) onChange(value);
    }
  };
  return bar;
}

/** A button that is on or off. */
export function toggle(id, text, on, hint, onChange) {
  const button = make("button", { type: "button", id, class: "toggle", "data-hint": hint, "aria-pressed": on }, text);
  button.set = (value) => {
    button.setAttribute("aria-pressed", value);
    onChange(value);
  };
  button.addEventListener("click", () => button.set(button.getAttribute("aria-pressed") !== "true"));
  return button;
}

/** A length of the normalised frame for people: three significant digits. */
export const digits = (value, count = 3) =>
  value == null ? "–" : value === 0 ? "0" : Math.abs(value) < 1e-4 ? "< 0.0001" : String(+value.toPrecision(count));

/** A number of a column: the same number of digits in every row. */
export const column = (value, count = 2) =>
  value === 0 || Math.abs(value) < 1e-4 ? digits(value) : Math.abs(value) >= 10 ** count ? value.toFixed(0) : value.toPrecision(count);

/** A length of the frame in plain words, in the unit of a scene: "0.0226 m", or "0.0226 units" where the file does not say which. */
export function measure(value, { unit }, count = 3) {
  if (value == null) return "–";
  const told = value / unit.length;
  return `${told < 1e-4 && told > 0 ? told.toExponential(1) : digits(told, count)}\u00a0${unit.name}`;
}

export const plural = (count, word) => `${count.toLocaleString("en")} ${word}${count === 1 ? "" : "s"}`;
