"""Every option with every odd value: accepted, or an OptionError in one sentence before any work."""

from __future__ import annotations

import dataclasses
import fractions
import inspect
import itertools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from trimesh import creation

import rlacd
from rlacd.batch.job_spec import JobSpec
from rlacd.cli.main import app
from rlacd.cli.options import decompose_options
from rlacd.compat import coacd, vhacd
from rlacd.errors import MeshFileError, OptionError, RlacdError, WeightsError
from rlacd.learn.options import TrainOptions
from rlacd.options import OPTION_NAMES, Options
from rlacd.options.fields import check_callback
from rlacd.options.names import SCORES as SCORE_NAMES
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import OutputOptions
from rlacd.options.ranges import LENGTHS
from rlacd.policies.greedy import SCORES


class Hostile:
    """An object that raises whatever it is asked."""

    def _raise(self, *_: Any) -> Any:
        raise RuntimeError("asked")

    __eq__ = __bool__ = __len__ = __iter__ = __float__ = __int__ = __index__ = __repr__ = __str__ = _raise  # type: ignore[assignment]
    __hash__ = __getitem__ = __contains__ = __fspath__ = __call__ = _raise  # type: ignore[assignment]


ODD: dict[str, Any] = {
    "None": None,
    "True": True,
    "bool of numpy": np.True_,
    "0": 0,
    "-1": -1,
    "huge": 10**30,
    "too long to print": 10**5000,
    "too small": -(10**5000),
    "0.5": 0.5,
    "denormal": 1e-320,
    "NaN": float("nan"),
    "infinity": float("inf"),
    "int8": np.int8(5),
    "0-d array": np.array(0.1),
    "array": np.array([0.1, 0.2]),
    "matrix": np.eye(3),
    "strings in an array": np.array([["1", "2", "3"]]),
    "objects": np.array([[10**400, 1, 2]], dtype=object),
    "complex": 1 + 2j,
    "fraction": fractions.Fraction(1, 3),
    "empty": "",
    "word": "word",
    "number in words": "0.05",
    "name": "fast",
    "NUL": "a\0b",
    "surrogate": "\ud800.onnx",
    "two lines": "two\nlines",
    "bytes": b"fast",
    "list": [],
    "list of lists": [[1, 2, 3]],
    "ragged": [[1, 2], [3]],
    "planes of words": [("abc", "d")],
    "planes": [((0, 0, 1), 0)],
    "planes of NaN": [((0, 0, float("nan")), 0)],
    "dict": {},
    "endless": itertools.count(),
    "endless planes": itertools.repeat(((0, 0, 1), 0)),
    "class": int,
    "class of options": rlacd.NavigableSpace,
    "space": rlacd.NavigableSpace(),
    "function": lambda: None,
    "hostile": Hostile(),
    "hostile in a list": [Hostile()],
    "object": object(),
    "path": Path("a/b"),
}


def assert_accepted_or_told(call: Any, *others: type[Exception]) -> None:
    """Whatever is not accepted is one sentence."""
    told = "one sentence of some length"
    try:
        call()
    except OptionError as error:
        told = str(error)
    except others:
        pass
    assert len(told.splitlines()) == 1
    assert 20 < len(told) < 500


@pytest.mark.filterwarnings("ignore:.*is now called:DeprecationWarning")
@pytest.mark.parametrize("odd", ODD.values(), ids=ODD.keys())
@pytest.mark.promise("options")
def test_options_of_decompose_are_checked_before_any_work(odd: Any) -> None:
    for name in (*OPTION_NAMES, "progress"):
        # Python 3.13 takes a hostile object for a function that can be called: what it raises then is the caller's own.
        raised = (RuntimeError,) if name == "progress" and isinstance(odd, Hostile) else ()
        assert_accepted_or_told(
            lambda name=name: rlacd.decompose("no such file.obj", **{name: odd}), MeshFileError, WeightsError, *raised
        )


@pytest.mark.filterwarnings("ignore:.*is now called:DeprecationWarning")
@pytest.mark.parametrize("odd", ODD.values(), ids=ODD.keys())
def test_options_of_navigable_space_are_checked_when_it_is_made(odd: Any) -> None:
    for name in inspect.signature(rlacd.NavigableSpace).parameters:
        assert_accepted_or_told(lambda name=name: hash(rlacd.NavigableSpace(**{name: odd})))


@pytest.fixture(scope="module")
def result() -> rlacd.Decomposition:
    return rlacd.decompose(creation.box(), quality="fast")


@pytest.mark.slow
@pytest.mark.parametrize("odd", ODD.values(), ids=ODD.keys())
def test_options_of_what_is_written_are_checked(odd: Any, result: rlacd.Decomposition, tmp_path: Path) -> None:
    for name in ("file_type", "density", "up", "one_mesh"):
        assert_accepted_or_told(lambda name=name: result.save(tmp_path / "box.urdf", **{name: odd}), RlacdError)
    for place in (tmp_path / "box.png", odd):
        for name in ("width", "up"):  # a wrong ending, so that no picture is drawn
            given = {name: odd}
            assert_accepted_or_told(
                lambda p=place, g=given: result.save_picture(Path(str(p) + "x") if p is not odd else p, **g), RlacdError
            )
    assert_accepted_or_told(lambda: result.save_report(tmp_path / "no folder" / "a.html", up=odd), RlacdError)


@pytest.mark.parametrize("odd", ODD.values(), ids=ODD.keys())
def test_options_of_the_other_functions_are_checked(odd: Any, tmp_path: Path) -> None:
    missing = tmp_path / "missing.urdf"
    for name in ("robot", "output", "package_dirs"):
        given = {"robot": missing, "output": tmp_path / "out.urdf", name: odd}
        assert_accepted_or_told(lambda given=given: rlacd.rewrite_robot(**given), RlacdError)
    nothing = coacd.Mesh()
    for name in inspect.signature(coacd.run_coacd).parameters.keys() - {"mesh"}:
        assert_accepted_or_told(lambda name=name: coacd.run_coacd(nothing, **{name: odd}), RlacdError)
    for name in ("maxConvexHulls", "maxNumVerticesPerCH", "asyncACD"):
        assert_accepted_or_told(lambda name=name: vhacd.compute_vhacd([], [], **{name: odd}), RlacdError)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {"threshold": "2.05"},
            r"threshold is 2\.05; it has to be a number between 0\.001 and 2 .* '10mm'\.",
        ),
        ({"threshold": [0.1]}, r"threshold is \[0\.1\]; it has to be a number between 0\.001 and 2 "),
        ({"max_hulls": 2.5}, r"max_hulls is 2\.5; it has to be an integer, at least 1\."),
        ({"preset": []}, r"preset is \[\]; it has to be one of mujoco, physx, "),
        ({"quality": np.eye(2)}, r"quality is array\(\[\[1\., 0\.\], \[0\., 1\.\]\]\); it has to be one of fast, "),
        (
            {"criterion": np.zeros(2)},
            r"criterion is array\(.*\); it has to be concavity, distance, volume or an `rlacd\.NavigableSpace`",
        ),
        ({"seed": 10**5000}, "seed is an object of type int; it has to be an integer between 0 and"),
        (
            {"progress": lambda: None},
            r"progress is <function .*; it has to be a function that takes a `rlacd\.Progress`",
        ),
        ({"progress": int}, "progress is <class 'int'>"),
    ],
)
@pytest.mark.promise("options")
def test_the_message_shows_the_value_and_what_it_has_to_be(given: dict[str, Any], says: str) -> None:
    with pytest.raises(OptionError, match=says):
        rlacd.decompose("no such file.obj", **given)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        *(
            ({"criterion": criterion, name: usual}, f"{name} is {usual!r}; it has to be left out: the criterion")
            for criterion, names in [("volume", ["threshold"]), ("distance", ["volume_tolerance", "volume_of"])]
            for name, usual in ((name, getattr(Options, name)) for name in names)
        ),
        *(({name: getattr(Options, name), f"{name}_abs": 0.1}, f"left out with {name}_abs") for name in LENGTHS),
        ({"keep_open": 0.9, "keep_open_abs": 0.1}, "left out with keep_open_abs"),
        ({"relative_to": "scene"}, "left out without per_node"),
        ({"relative_to": "node", "per_node": True, "threshold_abs": 0.1}, "every length is in the mesh's unit"),
        ({"quality": "fast", "search_steps": 0}, "left out with quality='fast'"),
        ({"quality": "best", "merge": False}, "quality is 'best'; it has to be 'fast'"),
    ],
)
@pytest.mark.promise("options")
def test_an_option_that_another_overrides_is_refused_even_with_its_default(
    tmp_path: Path, given: dict[str, Any], says: str
) -> None:
    mesh = tmp_path / "box.stl"
    creation.box().export(mesh)
    robot = lambda: rlacd.rewrite_robot("no such file.urdf", "out.urdf", **given)  # noqa: E731
    of_robots = () if "relative_to" in given else (robot,)  # whose lengths are relative to all of it, or to a mesh
    for call in (lambda: rlacd.decompose(mesh, **given), lambda: JobSpec.of(given), *of_robots):
        with pytest.raises(OptionError, match=says):
            call()
    words = {"--" + ("tolerance" if n == "volume_tolerance" else n.replace("_", "-")): v for n, v in given.items()}
    typed = [word for flag, value in words.items() for word in ((flag,) if value is True else (flag, str(value)))]
    typed = ["--no-merge" if word == "--merge" else word for word in typed if word != "False"]
    run = CliRunner().invoke(app, ["decompose", str(mesh), *typed])
    assert run.exit_code == 2
    assert re.search(says, run.stderr) or "--tolerance needs --criterion volume" in run.stderr


def test_none_is_as_good_as_not_given() -> None:
    assert Options.of(dict.fromkeys(OPTION_NAMES)) == Options()


@pytest.mark.parametrize(
    ("call", "name", "says"),
    [
        (rlacd.decompose, "treshold", "; did you mean threshold?"),
        (rlacd.decompose, "max_convex_hull", "; did you mean max_hulls?"),
        (rlacd.decompose, "radius_abs", "it belongs to NavigableSpace(radius_abs=)."),
        (rlacd.decompose, "tolerance", "How far hulls may be from the mesh is threshold='10mm'."),
        (rlacd.decompose, "density", "it belongs to .save(density=)."),
        (rlacd.decompose, "qwx", "'qwx'"),
    ],
)
def test_an_option_that_is_unknown_is_told_with_the_one_that_was_meant(call: Any, name: str, says: str) -> None:
    with pytest.raises(TypeError, match=rf"unexpected keyword argument '{name}'") as caught:
        call("no such file.obj", **{name: 1})
    assert str(caught.value).endswith(says)
    with pytest.raises(TypeError, match=r"rewrite_robot\(\) .* did you mean samples"):
        rlacd.rewrite_robot("no such file.urdf", "out.urdf", sample=9)


def test_callbacks_that_take_one_argument_are_accepted() -> None:
    async def later(progress: Any) -> None: ...

    for fits in (print, lambda p: None, lambda p, q=1: None, lambda *p: None, [].append, Options.__init__.__get__):
        check_callback("progress", fits, "one")
    for wrong in (lambda p, q: None, lambda *, p: None, later, dict, 3):
        with pytest.raises(OptionError):
            check_callback("progress", wrong, "one")


@pytest.mark.parametrize("given", [{"radius": 1e-320}, {"tolerance": 1e300}, {"radius": 21}, {"tolerance": 1e-9}])
def test_shares_that_no_object_can_have_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(OptionError, match=r"a number between 0\.0002 and 20"):
        rlacd.NavigableSpace(**given)


@pytest.mark.parametrize("given", [{"radius_abs": 1e-320}, {"tolerance_abs": 1e300}, {"radius_abs": 1e-5}])
def test_lengths_that_do_not_fit_the_object_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(
        OptionError,
        match=r"is .*% of this object's longest side, 1 in its unit; .* 0\.01% and 1000%: is the unit",
    ):
        rlacd.decompose(creation.box(), criterion=rlacd.NavigableSpace(**given))


# --- lengths in words -------------------------------------------------------------------------------------------------


def test_a_length_is_given_alike_whatever_it_is_a_length_of() -> None:
    """A number where the longest side is 2, a share of that side, or a length with a unit."""
    for name in ("threshold", "overlap", "gap", "radius", "tolerance"):
        made = [
            NavigableSpace(**{name: given}) if hasattr(NavigableSpace, name) else Options.of({name: given})
            for given in (0.1, "0.1", " 5 %")
        ]
        assert {getattr(one, name) for one in made} == {0.1}
    inches = Options.of({"threshold": "1in", "overlap": "5 mm"}).in_unit(0.0254, "mesh")
    assert (inches.threshold_abs, inches.overlap_abs) == pytest.approx((1.0, 5 / 25.4))
    assert inches.criterion == "distance"
    space = Options.of({"criterion": NavigableSpace("4%", "2cm")}).in_unit(1e-3, "mesh").criterion
    assert (space.radius, space.tolerance_abs) == pytest.approx((0.08, 20.0))
    shares = Options.of({"criterion": "volume", "volume_tolerance": "2%", "keep_open": "90%"})
    assert (shares.volume_tolerance, shares.keep_open) == (0.02, 0.9), "shares of other things"


def test_a_length_with_a_unit_is_kept_until_the_mesh_says_its_own() -> None:
    for given in ({"threshold": "2mm", "keep_open": "1cm"}, {"criterion": NavigableSpace(radius="2mm")}):
        options = Options.of(given)
        plain = json.loads(json.dumps(options.as_plain()))
        again = Options.of(plain)
        assert again.as_plain() == options.as_plain()
        assert (again.typed_unit, again.in_unit(1.0, "mesh").typed_unit) == ("mm", None)
    cube = creation.box()
    with pytest.raises(OptionError, match=r"threshold is 2mm, but Trimesh does not say its unit: .* threshold_abs"):
        rlacd.decompose(cube, threshold="2mm")
    assert rlacd.decompose(cube, threshold="2mm", unit="cm").report.options["threshold_abs"] == 0.002
    assert rlacd.decompose(cube, threshold="20%").report.options["threshold"] == 0.4


@pytest.mark.parametrize("word", ["tight", "5 %%", "", "1e", "m", "0.1 miles", "nan%"])
def test_words_that_are_no_lengths_are_refused(word: str) -> None:
    wants = {"threshold": Options.of, "overlap": decompose_options, "radius": lambda given: NavigableSpace(**given)}
    for name, given in wants.items():
        with pytest.raises(OptionError, match=f"{name} is"):
            given({name: word})
    for name in ("gap", "volume_tolerance"):
        with pytest.raises(OptionError, match=f"{name} is '2mm'; it has to be a number or a share"):
            Options.of({name: "2mm"})
    with pytest.raises(OptionError, match="threshold is '2mm' and threshold_abs is 1"):
        Options.of({"threshold": "2mm", "threshold_abs": 1.0})


# --- stated once ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [Options, NavigableSpace, OutputOptions, TrainOptions])
def test_every_option_is_explained(options: Any) -> None:
    fields = dataclasses.fields(options)
    assert all(field.metadata["option"].help.endswith(".") for field in fields)


def test_the_names_of_scores_are_those_that_are_known() -> None:
    assert set(SCORE_NAMES) == set(SCORES)


def test_plain_values_are_kept() -> None:
    options = Options(threshold=np.float32(0.5), seed=np.uint8(3), merge=np.False_, policy=np.str_("navacd"))
    kinds = [type(value) for value in (options.threshold, options.seed, options.merge, options.policy)]
    assert kinds == [float, int, bool, str]
    assert options.criterion == "concavity"
