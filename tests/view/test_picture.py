"""Pictures: every hull is seen, in its colour, the same way every time, wherever and however large the mesh is."""

from __future__ import annotations

import importlib
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

from rlacd.decomposition import Decomposition
from rlacd.errors import MissingExtraError, OptionError, OutputError
from rlacd.fit import LengthFit
from rlacd.viewer.picture import check_picture, draw_picture
from tests.hulls import hull_of, moved

Image = pytest.importorskip("PIL.Image", reason="the extra view is not installed")
pytest.importorskip("mitsuba", reason="the extra view is not installed")

WIDTH = 300


def towers(scale: float = 1.0, shift: float = 0.0) -> Decomposition:
    """Four boxes in a row, none of which hides another."""
    boxes = [trimesh.creation.box((0.6, 0.6, 1.0 + 0.3 * i)).vertices + np.array([1.2 * i, 0.0, 0.0]) for i in range(4)]
    hulls = [moved(hull_of(box), scale, [shift, shift, shift]) for box in boxes]
    concavity = LengthFit(None, 0.04, 0.05)
    return Decomposition.of(hulls, trimesh.util.concatenate(hulls), name="towers", concavity=concavity)


def pixels(path: Path) -> npt.NDArray[np.int64]:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def hues(image: npt.NDArray[np.int64]) -> set[int]:
    """Coarse hues of the coloured pixels."""
    hsv = np.asarray(Image.fromarray(image.astype(np.uint8)).convert("HSV")).reshape(-1, 3)
    counts = np.bincount(hsv[hsv[:, 1] > 80, 0] // 8, minlength=32)
    return {int(hue) for hue in np.flatnonzero(counts > 20)}


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return draw_picture(towers(), tmp_path_factory.mktemp("picture") / "usual.png", width=WIDTH, samples=4)


def test_every_hull_shows_its_colour_and_the_input_is_grey(usual: Path) -> None:
    image = pixels(usual)
    panel = WIDTH // 3
    given, together, apart = (image[:, k * panel : (k + 1) * panel] for k in range(3))
    body = slice(image.shape[0] // 4, -image.shape[0] // 8)
    assert hues(given[body]) == set()
    assert (given[body].max(axis=2) < 235).mean() > 0.05, "the input is not there"
    assert len(hues(together[body])) >= 4
    assert len(hues(apart[body])) >= 4
    assert (image[0, :] == 255).all(), "the paper is white"


def test_the_same_result_gives_the_same_bytes(tmp_path: Path, usual: Path) -> None:
    assert draw_picture(towers(), tmp_path / "again.png", width=WIDTH, samples=4).read_bytes() == usual.read_bytes()


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e6)])
def test_size_and_place_do_not_matter(tmp_path: Path, usual: Path, scale: float, shift: float) -> None:
    other = pixels(draw_picture(towers(scale, shift), tmp_path / "other.png", width=WIDTH, samples=4))
    assert np.abs(pixels(usual) - other).mean() < 1.5


def test_up_turns_the_picture(tmp_path: Path, usual: Path) -> None:
    images = [pixels(draw_picture(towers(), tmp_path / f"{up}.png", width=WIDTH, samples=1, up=up)) for up in "xy"]
    for a, b in itertools.combinations([*images, pixels(usual)], 2):
        assert np.abs(a - b).mean() > 2.0


def test_a_single_point_like_hull_and_a_sheet_as_input_can_be_drawn(tmp_path: Path) -> None:
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    slab = hull_of(trimesh.creation.box((1.0, 1.0, 1e-6)).vertices)
    path = Decomposition.of([slab], sheet).save_picture(tmp_path / "sheet.png", width=WIDTH)
    assert pixels(path).min() < 200


def test_bad_places_and_options_are_refused_before_drawing(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"must end in \.png"):
        check_picture(tmp_path / "out.jpg")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        check_picture(tmp_path / "file" / "out.png")
    for options in ({"width": 10}, {"width": 100_000}, {"samples": 0}, {"up": "w"}):
        with pytest.raises(OptionError):
            draw_picture(towers(), tmp_path / "out.png", **options)
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


@pytest.mark.parametrize("module", ["mitsuba", "PIL"])
def test_a_missing_extra_is_one_sentence_with_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"pip install 'rlacd\[view\] @ git") as raised:
        towers().save_picture(tmp_path / "out.png")
    assert isinstance(raised.value, ImportError)


def test_an_extra_that_does_not_load_is_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(module: str) -> None:
        raise ImportError("libatomic.so.1: cannot open shared object file")

    monkeypatch.setattr(importlib, "import_module", fail)
    with pytest.raises(MissingExtraError, match=r"does not load here \(libatomic"):
        towers().save_picture(tmp_path / "out.png")


def test_drawing_leaves_stdout_and_stderr_alone(tmp_path: Path) -> None:
    """In a process of its own: what Mitsuba's libraries say, they say once, when they are loaded."""
    code = (
        "import sys, trimesh; from rlacd.decomposition import Decomposition; box = trimesh.creation.box();"
        "Decomposition.of([box], box).save_picture(sys.argv[1], width=300); print('drawn', file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "out.png")]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "drawn\n")
