"""The joint report of a scene's nodes, which were decomposed for themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np

from rlacd.report import Avoids, Hausdorff, Mass, NodeHulls, Overlap, Report
from rlacd.solid.arrays import dots


def joint_report(reports: Sequence[tuple[str, Report]], scale: float) -> Report:
    """Join the reports of a scene's nodes, which were decomposed separately.

    Parameters
    ----------
    reports : sequence of (str, Report)
        Each node's name and report.
    scale : float
        Frame units of the scene per unit of the input; joint lengths are in that frame.
    """
    each, factors = [report for _, report in reports], [scale / report.scale for _, report in reports]
    first, stopped = each[0], next((report for report in each if not report.complete), each[0])
    begins = [*accumulate((len(report.repair) for report in each), initial=0)]
    bodies = [*zip(reports, factors, begins, strict=False)]
    return Report(
        options=first.options,
        complete=stopped.complete,
        stopped_by=stopped.stopped_by,
        **{what: sum(getattr(report, what) for report in each) for what in ("hulls", "triangles", "vertices")},
        primitives=_added([report.primitives for report in each]),
        overlap=_joint_overlap(each),
        **_joint_fit(each, factors),
        avoid=_joint_avoid([report.avoid for report in each if report.avoid is not None]),
        hausdorff=Hausdorff(
            _farthest([report.hausdorff.added for report in each], factors),
            _farthest([report.hausdorff.missed for report in each], factors),
        ),
        passages=tuple(replace(one, node=name) for name, report in reports for one in report.passages or ()),
        nodes=tuple(NodeHulls(name, report.hulls, report.scale) for name, report in reports),
        scale=scale,
        mass=_joint_mass([report.mass for report in each]),
        repair=tuple(
            replace(body, body=begin + i, deviation=body.deviation * factor, node=name)
            for (name, report), factor, begin in bodies
            for i, body in enumerate(report.repair)
        ),
        holes=tuple(
            replace(hole, body=begin + hole.body, node=name)
            for (name, report), _, begin in bodies
            for hole in report.holes
        ),
        lower_bound=_sum_known([report.lower_bound for report in each]),
        warnings=tuple(f"{name}: {warning}" for name, report in reports for warning in report.warnings),
        unit=first.unit,
    )


def _sum_known(counts: Sequence[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None


def _joint_fit(each: Sequence[Report], factors: Sequence[float]) -> dict[str, Any]:
    """The criterion's measurement of the parts of all nodes; lengths grow by each node's factor."""
    fits = [fit for report in each if (fit := report.fit) is not None]
    known, scaled = [fit.per_part for fit in fits if fit.per_part is not None], [*zip(fits, factors, strict=True)]
    errors = [e * fit.unit(factor) for fit, factor in scaled for e in fit.per_part or ()]
    found: dict[str, Any] = {"per_part": tuple(errors), "max": max(errors, default=None)}
    if len(known) < len(fits):
        found = {"per_part": None, "max": None}
    if fits[0].is_length:
        found["threshold"] = max(fit.limit * factor for fit, factor in scaled if fit.limit is not None)
    return {fits[0].key: replace(getattr(each[0], fits[0].key), **found)}


def _farthest(lengths: Sequence[float | None], factors: Sequence[float]) -> float | None:
    """The greatest of lengths, each times its factor; None if one is unknown."""
    known = [length * factor for length, factor in zip(lengths, factors, strict=True) if length is not None]
    return max(known) if len(known) == len(lengths) else None


def _joint_overlap(each: Sequence[Report]) -> Overlap | None:
    """Join the seams of all nodes, with parts numbered through."""
    overlaps = [report.overlap for report in each if report.overlap is not None]
    if not overlaps:
        return None
    if any(one.seams is None for one in overlaps):
        return Overlap()
    firsts = accumulate((report.hulls for report in each), initial=0)
    short = [
        replace(seam, hulls=(first + seam.hulls[0], first + seam.hulls[1]))
        for first, one in zip(firsts, overlaps, strict=False)
        for seam in one.short_seams or ()
    ]
    return Overlap(sum(one.seams or 0 for one in overlaps), len(short), tuple(short))


def _joint_avoid(each: Sequence[Avoids]) -> Avoids | None:
    """Join what hulls of all nodes enter: a mesh entered by several nodes is listed for each."""
    crossed = dict.fromkeys(name for one in each for name in one.crossed)
    return Avoids(tuple(crossed), tuple(entry for one in each for entry in one.entered)) if each else None


def _added(counts: Sequence[Mapping[str, int] | None]) -> dict[str, int] | None:
    known = [count for count in counts if count is not None]
    return {kind: sum(count[kind] for count in known) for kind in known[0]} if known else None


def _joint_mass(masses: Sequence[Mass]) -> Mass:
    """Add up bodies of density one that do not overlap."""
    volume = sum(mass.volume_abs for mass in masses)
    weights = [mass.volume_abs / volume if volume > 0 else 1 / len(masses) for mass in masses]
    centre = np.sum([weight * mass.centre_abs for weight, mass in zip(weights, masses, strict=True)], axis=0)
    inertia = np.zeros((3, 3))
    for mass in masses:
        away = mass.centre_abs - centre
        inertia += mass.inertia_abs + mass.volume_abs * (dots(away, away) * np.eye(3) - np.outer(away, away))
    return Mass(float(volume), centre, inertia)
