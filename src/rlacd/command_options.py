"""From what the user gave on the command line to the keyword arguments of `rlacd.decompose`."""

from __future__ import annotations

from typing import Any

from rlacd.errors import OptionError

NAVIGABLE = "navigable"
_SPACE = ("radius", "tolerance", "radius_m", "tolerance_m", "reachable_only", "seed_point", "closed_plane")
HOW = (
    *("threshold", "threshold_m", "criterion", *_SPACE),
    *("preset", "max_hulls", "max_vertices", "max_faces", "merge", "policy", "resolution", "seed", "threads"),
    *("timeout", "quality", "budget", "search_steps"),
)
"""Parameters of the command ``decompose`` that say how to decompose."""

_SPELLED = {"reachable-only": "everywhere"}


def decompose_options(given: dict[str, Any]) -> dict[str, Any]:
    """Keep what the user gave, and make the criterion of its own options.

    Parameters
    ----------
    given : dict
        Parameters of the command ``decompose`` that say how to decompose, by name; None where not given.

    Returns
    -------
    dict
        Keyword arguments of `rlacd.decompose`: defaults are stated once, by that.

    Raises
    ------
    OptionError
        Options contradict each other, or are not what they should look like.
    """
    given = {name: getattr(value, "value", value) for name, value in given.items() if value not in (None, [])}
    space = {name: given.pop(name) for name in _SPACE if name in given}
    navigable = given.pop("criterion", None) == NAVIGABLE
    if space and not navigable:
        option = next(iter(space)).replace("_", "-")
        raise OptionError(f"--{_SPELLED.get(option, option)} needs --criterion navigable.")
    if not navigable:
        return given
    if "threshold" in given or "threshold_m" in given:
        raise OptionError("--threshold belongs to --criterion concavity; give --radius and --tolerance instead.")
    from rlacd.criteria import NavigableSpace

    if "seed_point" in space:
        space["seeds"] = [_numbers("--seed-point", text, 3) for text in space.pop("seed_point")]
    if "closed_plane" in space:
        space["closed_planes"] = [_plane(text) for text in space.pop("closed_plane")]
    return {**given, "criterion": NavigableSpace(**space)}


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        raise OptionError(
            f"{option} is {text!r}; it takes {count} numbers with commas between, such as {'0,0,1,0'[: 2 * count - 1]}."
        )
    return values


def _plane(text: str) -> tuple[tuple[float, ...], float]:
    *normal, offset = _numbers("--closed-plane", text, 4)
    return tuple(normal), offset
