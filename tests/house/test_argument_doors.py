"""Arguments pass one door: odd arrays, odd operands and odd sources of random numbers end in an answer or an error."""

import inspect
import operator

import numpy as np
import pytest
from campaigns.cases.public_calls import CALLS, MISSING, method_calls

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import generator, numbers
from asperity.errors import InputError
from commands import ended

# numpy warns of its class of matrices whenever one is made
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
DISK = geo.Disk()
LAWS = [ker.lambertian(), ker.henyey_greenstein(0.5), ker.specular(), ker.CircularArcLaw(1.2)]
WITH_SOURCE = {
    name: (function, arguments)
    for name, (function, arguments) in {**CALLS, **method_calls()}.items()
    if "rng" in arguments and "Rng" in str(inspect.signature(function).parameters["rng"].annotation)
}
NO_SOURCES = {
    "matrix": np.eye(2).view(np.matrix), "list": [1, 2], "object": object(), "negative": -1, "huge": 10**5000,
    "beyond": 2**128, "true": True, "fraction": 1.5, "text": "1", "array": np.array([1]), "masked": np.ma.masked,
    "class": np.random.PCG64, "old": np.random.RandomState(0), "span": np.timedelta64(1, "s"),
}  # fmt: skip


MATRIX_CALLS = """
import numpy as np
from asperity import geometry as geo, kernels as ker
MATRIX = np.matrix("1 0.5; 0.5 1")
for call in (
    lambda: ker.lambertian().sample(1.0, MATRIX),
    lambda: ker.discretise(ker.lambertian(), ker.Bins(2), "monte-carlo", samples=64, rng=MATRIX),
    lambda: ker.CollisionLaw(ker.lambertian(), geo.Disk()).sample([[0.0, -1.0, 0.0]], MATRIX),
    lambda: ker.CircularArcLaw(1.2).apply(np.cos, MATRIX),
    lambda: ker.RectangularTeethLaw(1.0).conditionals(MATRIX, degree=0, edges=[1.0]),
    lambda: ker.WallLaw(geo.elliptical_arcs(1.0)).conditionals(MATRIX, degree=0, edges=[1.0]),
):
    try:
        call()
    except ValueError as reason:
        print(reason)
"""


def test_every_public_parameter_has_an_example():
    method_calls()
    assert not MISSING, "a row of `ARGUMENTS` or of `SPECIAL` in campaigns/cases/public_calls is missing"


def test_a_matrix_does_not_end_the_process():
    made = ended("-c", MATRIX_CALLS)
    assert made.returncode == 0, f"{made.returncode}: {made.stdout}{made.stderr}"


def test_all_public_callables_with_a_source_are_called():
    rooms = [(room, name) for room in (geo, ker, spec) for name in room.__all__]
    functions = [getattr(room, name) for room, name in rooms if inspect.isfunction(getattr(room, name))]
    taking = {one.__name__ for one in functions if "Rng" in str(inspect.signature(one).parameters.get("rng", ""))}
    assert taking == {name for name in WITH_SOURCE if "." not in name} - {"study_wall"} and len(WITH_SOURCE) > 60


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", WITH_SOURCE)
def test_a_source_of_random_numbers_passes_one_door(name):
    function, arguments = WITH_SOURCE[name]
    arguments = {**arguments, "cells": [geo.flat()] * 4} if name == "dichotomy" else arguments
    for source in NO_SOURCES.values():
        with pytest.raises(InputError, match=r"^rng: "):
            function(**{**arguments, "rng": source})


@pytest.mark.parametrize("law", [*LAWS, ker.discretise(LAWS[0], ker.Bins(4))])
def test_the_gap_refuses_a_wrong_source_also_where_it_needs_none(law):
    with pytest.raises(InputError, match=r"^rng: "):
        spec.spectral_gap(law, rng=[1])


def test_the_gap_takes_a_tolerance_in_an_array_of_no_dimension():
    assert spec.spectral_gap(LAWS[1], tolerance=np.array(0.1)) == spec.spectral_gap(LAWS[1], tolerance=0.1)


def test_the_door_of_sources_takes_what_numpy_recommends():
    wanted = np.random.default_rng(3).random()
    for source in (
        3,
        np.int64(3),
        np.uint8(3),
        np.random.SeedSequence(3),
        np.random.PCG64(3),
        np.random.default_rng(3),
    ):
        assert generator(source).random() == wanted
    assert generator(2**128 - 1).random() != generator(None).random()


@pytest.mark.parametrize(
    "call",
    [
        "ker.specular().sample({value}, {source})",
        "ker.WallLaw(geo.flat()).sample({value}, {source})",
        "ker.PositionLaw([0.0, 1.0], [ker.specular()]).sample(0.5, {value}, {source})",
        "ker.CollisionLaw(ker.specular(), geo.Disk()).sample({velocity}, {source})",
        "ker.SatelliteLaw(geo.flat(), geo.Disk(), 0.01).sample({velocity}, {source})",
    ],
)
def test_a_number_of_draws_is_not_taken_for_a_seed_and_the_remedies_work(call):
    names = {"ker": ker, "geo": geo, "np": np, "theta": 0.7, "velocity": np.array([[0.0, -1.0, 0.0]])}
    given = {"value": "0.7", "velocity": "velocity"}
    with pytest.raises(InputError, match="rng=1000 for a seed") as reason:
        eval(call.format(source="1000", **given), names)
    first = eval(call.format(source="rng=1000", **given), names)
    remedy = str(reason.value).split("for a seed, ")[1].split(" for 1000")[0]
    many = eval(remedy, {**names, "x": 0.5, "speed": 1.0})
    assert len(many) == 1000 and np.shape(first) is not None
    if "{value}" in call and "0.5" not in call:
        assert len(eval(call.format(value=remedy, source="rng=1"), names)) == 1000


def test_one_door_for_numbers():
    for refused in (
        np.ma.array([1.0, 2.0], mask=[True, False]), [np.ma.array([1.0], mask=[True])], np.ma.masked,
        [1.0, np.ma.masked], 1j, [1.0, 1j], np.array([1.0, 1j], dtype=object), ["0.5"], "0.5",
        np.array([np.complex128(1)], dtype=object),
        np.array(["0.5"], dtype=object), None, [None], np.array([np.timedelta64(1, "s")], dtype=object), 10**400, b"1",
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"^x: expected numbers"):
            numbers("x", refused)
    plain = np.array([[0.5, 1.0], [1.5, 2.0]])
    for given in (
        np.matrix(plain), plain.astype(">f8"), plain[::-1].copy()[::-1], np.asfortranarray(plain), plain.tolist(),
        plain.astype(object), np.ma.array(plain), plain.astype(np.longdouble), np.repeat(plain, 2, axis=1)[:, ::2],
    ):  # fmt: skip
        found = numbers("x", given)
        assert type(found) is np.ndarray and found.dtype == np.float64 and found.dtype.isnative
        assert found.flags.c_contiguous and np.array_equal(found, plain)


@pytest.mark.parametrize("law", LAWS)
def test_constants_and_functions_of_one_number(law):
    theta = np.array([0.5, 1.0, 2.0])
    assert law.apply(lambda angle: 1.0, theta) == pytest.approx(np.ones(3), abs=1e-12)
    assert law.apply(lambda angle: 1.0, 1.0) == pytest.approx(1.0, abs=1e-12)
    for scalar in (lambda angle: 1.0 if angle > 1.0 else 0.0, lambda angle: float(np.asarray(angle).item())):
        with pytest.raises(InputError, match=r"numpy\.vectorize"):
            law.apply(scalar, theta)
        # the remedy of the message
        assert law.apply(np.vectorize(scalar, otypes=[float]), theta).shape == (3,)
    for wrong in (lambda angle: None, lambda angle: "a", lambda angle: angle + 1j, lambda angle: np.append(angle, 1.0)):
        with pytest.raises(InputError):
            law.apply(wrong, theta)


def test_operators_refuse_what_is_no_operand_in_words():
    matrix = ker.discretise(ker.lambertian(), ker.Bins(4))
    collision = ker.CollisionLaw(ker.lambertian(), DISK)
    for wrong in (None, [None] * 4, np.ones(3), np.ones((4, 2, 2)), 1j * np.ones(4), ["a"] * 4, int):
        with pytest.raises(InputError):
            matrix @ wrong
    with pytest.raises(InputError, match=r"expected 4 entries for Bins\(4\), got shape \(3,\)"):
        matrix @ np.ones(3)
    assert matrix @ (lambda angle: 1.0) == pytest.approx(np.ones(4), abs=1e-12)
    for thing in (ker.lambertian(), collision, matrix, 0.5 * collision + 0.5 * ker.smooth(DISK), ker.Bins(4)):
        for what in (operator.add, operator.sub, operator.matmul, operator.mul, operator.truediv):
            masked = [] if what is operator.truediv else [np.ma.array([1.0, 2.0], mask=[True, False])]
            for other in (object(), "a", {}, *masked):
                with pytest.raises((TypeError, InputError)):
                    what(thing, other)
                with pytest.raises((TypeError, InputError)):
                    what(other, thing)
    for law in (ker.lambertian(), collision):
        with pytest.raises(InputError, match="weight"):
            10**400 * law


def test_objects_of_another_kind_are_refused_in_words_before_any_work():
    container, law = geo.Container.circle(), ker.CollisionLaw(ker.lambertian(), geo.Disk())
    teeth, bins, conditionals = geo.triangular_teeth(1.0), ker.Bins(4), ker.lambertian().conditionals([1.0])
    along = ker.CollisionAlongWall(ker.PositionLaw([0.0, 1.0], [ker.lambertian()]), geo.Disk())
    curve, found = geo.Bezier([(0, 0), (0.5, -1), (1, 0)]), spec.spectrum(ker.henyey_greenstein(0.5), 2)
    body = geo.SatelliteDisk(geo.Disk(), 24, 0.1)
    for name, call in {
        "container": lambda: ker.play(3, law, [0.5, 0.0], [0.0, 1.0, 0.0], 3),
        "container: ": lambda: along.check_wall(None, 0),
        "wall": lambda: along.coordinate(container, 5, [[0.0, 0.0]]),
        "limit": lambda: ker.limit_study(geo.Disk(), teeth, [0.1, 0.05, 0.02], limit="teeth"),
        "problem": lambda: spec.work_precision("integral", [], [1.0]),
        "basis": lambda: law.operator(bins, 3),
        "basis: ": lambda: conditionals.in_basis("bins"),
        "edges": lambda: conditionals.masses("edges"),
        "cells": lambda: ker.LeastResistanceLaw().flux([0.0, np.pi]),
        "axis": lambda: curve.turning_points(5),
        "tolerance": lambda: curve.flattened(10**400),
        "index": lambda: found.eigenfunction(9, 1.0),
        "velocity": lambda: container.next_wall([[0.0, 0.0]], [[1.0]], [-1]),
        "wall: ": lambda: geo.draw_wall("koch"),
        "ax": lambda: container.draw(3),
        "ax: ": lambda: found.plot("axes"),
        "spacing": lambda: geo.ConfigurationSpace(teeth, geo.Disk(), 0.01, 5e-324),
        "angle": lambda: geo.triangular_teeth(5e-324),
        "scale": lambda: geo.collide_rim(body, teeth, 1e300, [[0, 0]], [[0, -1, 0]]),
        "position in periods": lambda: geo.collide_rim(body, teeth, 0.01, [[1e300, 0]], [[0, -1, 0]]),
        "size": lambda: geo.SatelliteDisk(geo.Disk(), 24, np.zeros((), dtype=[("a", float)])),
    }.items():  # fmt: skip
        with pytest.raises(InputError, match=rf"^{name.removesuffix(': ')}: expected"):
            call()
