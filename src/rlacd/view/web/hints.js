// Explanations of terms: what carries `data-hint` shows it when pointed at, focused or tapped.
import { make } from "page/widgets";

const GAP = 8;

/** A word with its explanation. */
export const term = (text, hint) => make("span", { class: "term", tabindex: 0, "data-hint": hint, "aria-description": hint }, text);

/** Show hints for everything inside `root`. */
export function showHints(root) {
  const bubble = make("div", { id: "hint", role: "tooltip", hidden: true });
  document.body.append(bubble);
  const show = (event) => {
    const of = event.target.closest?.("[data-hint]");
    if (!of) return (bubble.hidden = true);
    bubble.textContent = of.dataset.hint;
    bubble.hidden = false;
    const place = of.getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height } = bubble;
    const below = place.bottom + GAP + height < innerHeight || place.top < height + GAP;
    bubble.style.left = `${Math.max(GAP, Math.min(place.left, innerWidth - width - GAP))}px`;
    bubble.style.top = `${below ? place.bottom + GAP : place.top - GAP - height}px`;
  };
  for (const event of ["pointerover", "focusin", "click"]) root.addEventListener(event, show);
  for (const event of ["pointerleave", "focusout"]) root.addEventListener(event, () => (bubble.hidden = true));
  addEventListener("keydown", () => (bubble.hidden = true));
  addEventListener("scroll", () => (bubble.hidden = true), true);
}
