"""Which side of a face is inside, where the angles between faces cannot tell; bodies for which windings suffice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.soup import FLAPS, FLAT, Soup, face_normals
from rlacd.repair.union import split_labels
from rlacd.repair.work import Piece, Work
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.manifold import to_manifold
from rlacd.solid.topology import BoolArray, IntArray, is_balanced, marked, signed_tetrahedra

BESIDE = HALF_THICKNESS / 5
"""Distance from a face at which the winding number is evaluated."""


def are_oriented(work: Work) -> bool:
    """Whether every edge joins two faces that run along it in opposite directions, and no body is flat."""
    soup = work.soup
    if (soup.edges.valence != 2).any() or not is_balanced(soup.faces, soup.edges).all():
        return False
    volume = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces))
    return bool((np.abs(volume) > 2 * FLAT * np.bincount(soup.body, soup.area)).all())


def take_as_they_are(work: Work) -> None:
    """Take closed, oriented bodies without sorting all sides."""
    soup = work.soup
    inward = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces)) < 0
    faces = np.where(inward[soup.body, None], soup.faces[:, ::-1], soup.faces)
    work.record.note(np.flatnonzero(inward), "reoriented")
    solids = [to_manifold(v, f) for v, f in split_labels(soup.vertices, faces, soup.body)]
    work.parts = [Piece(solid, body) for body, solid in enumerate(solids)]


def are_crowded(work: Work) -> bool:
    """Whether more than two faces meet in an edge of bodies that are still to be built."""
    return not work.parts and bool((work.soup.edges.valence > 2).any())


def sort_out(work: Work) -> None:
    """Find the sides of crowded bodies by windings where angles fail, and without the faces that hide inside."""
    work.soup = _without_hidden(trust_windings(work.soup, work.record.bodies), work)


def trust_windings(soup: Soup, bodies: int, flap: BoolArray | bool = False) -> Soup:
    """Trust the windings of closed bodies if the angles between their faces join the inside with the outside.

    Where corners were rounded, slivers fold over, and noise turns faces that nearly lie in one plane: then angles
    around an edge with four faces are wrong.

    Parameters
    ----------
    soup
    bodies
        Number of bodies.
    flap
        Faces ``[F]`` that need no inside.
    """
    is_crowded = soup.edges.valence > 2
    if not is_crowded.any():
        return soup
    crowded = marked(soup.body[soup.at_valence(is_crowded)], bodies)
    uneven = marked(soup.body[soup.at_valence(~is_balanced(soup.faces, soup.edges))], bodies)
    if not (crowded & ~uneven).any():
        return soup
    share = soup.sheet_share(bodies, flap)
    doubted = crowded & ~uneven & (share > FLAPS)
    if not doubted.any():
        return soup
    before = False if soup.trusted is None else soup.trusted
    trusting = replace(soup, known_edges=soup.edges, trusted=before | doubted[soup.body])
    better = doubted & (trusting.sheet_share(bodies, flap) < share / 2)
    return replace(soup, known_edges=soup.edges, trusted=before | better[soup.body]) if better.any() else soup


def _without_hidden(soup: Soup, work: Work) -> Soup:
    """Drop faces that lie inside their own body, if they are what keeps the body from having an inside.

    Where parts meet in faces that overlap without matching, the order of faces around an edge is undecided, and one
    wrong guess joins the inside with the outside. The winding number is not affected.
    """
    bodies = work.record.bodies
    crowded = marked(soup.body[soup.at_valence(soup.edges.valence > 2)], bodies)
    share = soup.sheet_share(bodies)
    hidden = np.zeros(len(soup.faces), dtype=bool)
    for body in np.flatnonzero(crowded & (share > FLAPS)):
        poll_stop()
        some = np.flatnonzero(soup.body == body)
        hidden[some] = _hidden_faces(soup.vertices, soup.faces[some])
    if not hidden.any():
        return soup
    better = soup.only(~hidden).sheet_share(bodies) < share / 2
    work.record.note(soup.body[hidden & better[soup.body]], "outer skin")
    return soup.only(~hidden | ~better[soup.body])


def _hidden_faces(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Return ``[F]`` which faces of one body it winds around on both sides."""
    middle, step = vertices[faces].mean(axis=1), BESIDE * face_normals(vertices, faces)
    query = SurfaceQuery(vertices, faces)
    sign = -1 if signed_tetrahedra(vertices, faces).sum() < 0 else 1
    # On a skin the sides have 0 and 1; a wall inside has 0.5 and 1.5. A skin that lies double has 0 and 2.
    before = sign * query.winding(middle + step)
    hidden: BoolArray = before > 0.25
    behind = sign * query.winding((middle - step)[hidden])
    hidden[hidden] = (behind > 0.25) & ((before[hidden] + behind) / 2 > 0.75)
    return hidden
