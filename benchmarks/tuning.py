"""Equal accuracy: for each method, find the setting at which its mean D_h over a set of meshes matches a target.

This is the protocol of RL-ACD (4.4): fewer hulls may just mean looser hulls, so tools are compared where they are
equally tight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.methods import Method, make_method
from benchmarks.runner import Bench, is_outdated
from benchmarks.store import Row
from rlacd.errors import OptionError

CLOSE = 0.02
"""Default tolerance on the mean D_h, relative to the target."""

TRIES = 8
"""Maximum number of settings to try beyond those already known."""

STRIDE = 1.6
"""Factor between settings while the target is not bracketed."""

RANGES = {"threshold": (0.005, 1.0), "tolerance": (0.005, 1.0), "hulls": (1.0, 1024.0)}
"""Valid settings, by their meaning."""


@dataclass(frozen=True)
class Point:
    """One setting of a method, over the whole set of meshes.

    Attributes
    ----------
    setting : float
    rows : list of Row
        Rows of all meshes, including failed ones.
    """

    setting: float
    rows: list[Row]

    @property
    def good(self) -> list[Row]:
        """The meshes that did not fail."""
        return [row for row in self.rows if "error" not in row]

    @property
    def hausdorff(self) -> float:
        """Mean D_h; nan if all meshes failed."""
        good = self.good
        return sum(row["hausdorff"] for row in good) / len(good) if good else math.nan


def known_curve(bench: Bench, method: str) -> list[Point]:
    """Settings at which the store holds every mesh of the set, in ascending order."""
    by_setting: dict[float, dict[str, Row]] = {}
    for row in bench.store.rows():
        if row["method"] == method and not is_outdated(row):
            by_setting.setdefault(row["setting"], {})[row["mesh"]] = row
    whole = [s for s, rows in by_setting.items() if all(name in rows for name in bench.names)]
    return [Point(s, [by_setting[s][name] for name in bench.names]) for s in sorted(whole)]


def tune(bench: Bench, method: str, target: float, close: float = CLOSE) -> Point:
    """Find the setting at which a method's mean D_h matches the target to within the relative tolerance `close`.

    The search starts from the settings in the store. Once two of them bracket the target, it uses regula falsi, with
    bisection where that converges slowly.

    Raises
    ------
    OptionError
        The target is not positive.

    Returns
    -------
    Point
        The closest one found, even if it misses the tolerance.
    """
    if not target > 0:
        raise OptionError(f"the mean D_h to reach is {target}; it has to be positive.")
    tool = make_method(method)
    points = known_curve(bench, method)
    for attempt in range(TRIES):
        usable = [p for p in points if not math.isnan(p.hausdorff)]
        if any(abs(p.hausdorff - target) <= close * target for p in usable) or (points and not usable):
            break
        setting = next_setting(tool, [(p.setting, p.hausdorff) for p in usable], target, attempt)
        if setting is None or any(p.setting == setting for p in points):
            break
        points.append(Point(setting, bench.run(method, setting)))
        points.sort(key=lambda p: p.setting)
    if not points:
        raise OptionError("there are no meshes to tune on.")
    return min(points, key=lambda p: math.inf if math.isnan(p.hausdorff) else abs(p.hausdorff - target))


def next_setting(tool: Method, known: Sequence[tuple[float, float]], target: float, attempt: int) -> float | None:
    """Choose the next setting from known (setting, mean D_h); None if there is none left to try."""
    lowest, highest = RANGES[tool.setting]
    if not known:
        return _rounded(tool, target if tool.setting in ("threshold", "tolerance") else tool.default)
    sign = -1 if tool.setting == "hulls" else 1  # more hulls are tighter
    looser = [(s, d) for s, d in known if d > target]
    tighter = [(s, d) for s, d in known if d < target]
    if looser and tighter:
        # Mean D_h need not be monotone: the two closest settings that bracket the target are used.
        (a, da), (b, db) = min(
            ((t, loose) for t in tighter for loose in looser), key=lambda p: abs(math.log(p[0][0] / p[1][0]))
        )
        share = 0.5 if attempt % 3 == 2 else (target - da) / (db - da)
        return _rounded(tool, math.exp(math.log(a) + share * math.log(b / a)))
    # Not bracketed: extrapolate along the line through the two closest, by at most one stride.
    ordered = sorted(known, key=lambda k: abs(k[1] - target))
    outermost = ordered[0][0]
    step = math.log(STRIDE) * (sign if tighter else -sign)
    if len(ordered) > 1 and ordered[0][1] != ordered[1][1] and ordered[0][0] != ordered[1][0]:
        (a, da), (b, db) = ordered[:2]
        proposed = math.log(a / b) * (target - da) / (da - db)
        if proposed * step > 0:
            step = math.copysign(min(abs(proposed), abs(step)), step)
    wanted = min(max(outermost * math.exp(step), lowest), highest)
    return None if wanted == outermost else _rounded(tool, wanted)


def _rounded(tool: Method, number: float) -> float:
    """Round to three digits, so that settings are easy to repeat."""
    return float(round(number)) if tool.setting == "hulls" else float(f"{number:.3g}")
