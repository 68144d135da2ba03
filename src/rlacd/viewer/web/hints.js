// Explanations of terms: what carries `data-hint` shows it when pointed at, focused or tapped.
import { make } from "page/widgets";

const GAP = 8;

/** A word with its explanation. */
export const term = (text, hint) => make("span", { class: "term", tabindex: 0, "data-hint": hint, "aria-description": hint }, text);

/** Show hints for everything inside `root`. */
export function showHints(root) {
  const bubble = make("div", { id: "hint", role: "tooltip", hidden: true });
  document.body.append(bubble);
  let of = null;
  const put = () => {
    const place = of?.getBoundingClientRect();
    bubble.hidden = !of || place.bottom < 0 || place.top > innerHeight;
    if (bubble.hidden) return;
    bubble.textContent = of.dataset.hint;
    const { offsetWidth: width, offsetHeight: height } = bubble;
    const below = place.bottom + GAP + height < innerHeight || place.top < height + GAP;
    bubble.style.left = `${Math.max(GAP, Math.min(place.left, innerWidth - width - GAP))}px`;
    bubble.style.top = `${below ? place.bottom + GAP : place.top - GAP - height}px`;
  };
  const point = (at) => {
    of = at;
    put();
  };
  for (const event of ["pointerover", "focusin", "click"]) root.addEventListener(event, ({ target }) => point(target.closest?.("[data-hint]")));
  for (const event of ["pointerleave", "focusout"]) root.addEventListener(event, () => point(null));
  addEventListener("keydown", () => point(null));
  addEventListener("scroll", put, true); // also where a focus scrolls to
}
