"""Every public result says what it is in a few lines, in a terminal and in a notebook."""

import re
from dataclasses import is_dataclass
from importlib import import_module

import numpy as np
import pytest
import sympy
from campaigns.cases.public_calls import CALLS, DISK, LAW, OBJECTS, TEETH
from docs.reference import RETURNED, returned_classes
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity import verify
from asperity.core.estimates import Estimate, Summary, html_table, shown, text_of, with_error, with_errors
from asperity.errors import InputError
from asperity.study import study_wall
from html_pages import Balanced

# Lines of a result, and characters of a line; a study has one more for every fact of a disk.
LINES, LINE = 18, 180
# Words of the code, and reprs of Python's and numpy's own.
PRIVATE = (
    "indexed",
    "contains-spectrum",
    "Directions",
    "object at 0x",
    "array(",
    "dtype",
    "mappingproxy",
    "value=",
    "+-",
)
# What is no result but is combined with others shows the expression or the constructor that makes it, in one line.
EXPRESSIONS = {
    "AngularMeasure", "BranchLaw", "CollisionCombination", "Combination", "Composition", "Curve", "Defect",
    "DirectionFactor", "DirectionLaw", "DrivenLaw", "HemisphereCombination", "Hollow", "Power", "Reflector",
    "SpecularFrame", "SymmetryDefect", "VelocityLaw",
    # a constant of a theorem, the facts of a method: one line too
    "CollisionConstants", "MethodFacts", "Separation",
}  # fmt: skip
# Calls that `CALLS` refuses on purpose, or that take long there.
QUICK = {
    "extremal_resistance": lambda: ker.extremal_resistance(8),
    "design_wall": lambda: ker.design_wall(ker.resistance, ker.maxwell, [(0.5, 1.0)], "max", 0.1, grid=3),
    "wall_for": lambda: ker.wall_for(LAW, 2, 0.1, rng=0),
    "wall_from_text": lambda: geo.WALLS["koch"],
    "Wall": TEETH.plan,
    "Law": lambda: LAW.table(8, 9),
    "KernelMatrix": lambda: ker.discretise(LAW, ker.Bins(64), "monte-carlo", samples=256, rng=0),
    "CollisionLaw": lambda: ker.CollisionLaw(LAW, DISK),
    "HemisphereLaw": lambda: ker.HemisphereLaw(LAW).matrix(3, 1),
    "PolygonalBody": lambda: ker.PolygonalBody([[(0, 0), (1, 0), (0, 1)]]).force(0.0),
    "Spectrum": lambda: spec.spectrum(ker.discretise(LAW, ker.Bins(32)), 20),
    "SweepTable": lambda: spec.sweep(ker.CircularArcLaw, {"half_angle": [0.5, 2.0]}, ["gap", "eta"], progress=False),
    "ensemble": lambda: spec.ensemble(half_diffuse, 4, ["gap", "resistance"], 0.1, rng=0),
    "WorkReport": lambda: CALLS["work_precision"][0](**CALLS["work_precision"][1]),
    "verify": lambda: verify(sympy.Symbol("x", real=True), 0),
    "Profile": lambda: geo.Profile(np.arange(400.0), np.sin(np.arange(400.0)), "nm"),
    "Container": lambda: geo.Container.stadium(1.0, 1.0),
    "RoughBody": lambda: ker.RoughBody.disk(LAW),
    "conditionals": lambda: ker.TriangularTeethLaw(1.0).conditionals(np.linspace(0.1, 3.0, 500)),
    "study_wall": lambda: study_wall(geo.flat(), "a <b> & c", bins=4),
    "prove_gap": lambda: spec.prove_gap(ker.maxwell(0.5), 1e-2),
    "accommodation": lambda: spec.accommodation(ker.maxwell(0.5), 0.1, incidence_deg=[0.0, 30.0, 60.0]),
    "collide": lambda: geo.trace(TEETH, np.linspace(0.0, 1.0, 1000), 1.0),
}  # fmt: skip
# Without one of their own they are refused, compiled for long, or in tests of their own.
LEFT_OUT = {
    "SINE", "billiard_map", "collide_cylinder", "collide_modified", "collide_pair", "dichotomy", "limit_study",
    "shadow", "weak_limit",
}  # fmt: skip


def half_diffuse(rng):
    return ker.maxwell(np.random.default_rng(rng).uniform(0.25, 0.75))


def made() -> dict[str, object]:
    names = [name.rpartition(".")[2] for name in RETURNED]
    others = {name: lambda name=name: CALLS[name][0](**CALLS[name][1]) for name in names if name in CALLS}
    return {name: call for name, call in {**others, **QUICK}.items() if name not in LEFT_OUT}


def result_classes() -> dict[str, type]:
    found = {}
    for full in (one for names in returned_classes().values() for one in names):
        module, _, name = full.rpartition(".")
        found[name] = getattr(import_module(module), name)
    return found


def summaries(kind: type = Summary) -> set[type]:
    return {kind}.union(*map(summaries, kind.__subclasses__()))


def check(found: object) -> None:
    text, printed = repr(found), str(found)
    for one in (text, printed):
        assert len(one.splitlines()) <= LINES and max(map(len, one.splitlines())) <= LINE, one
        assert not any(word in one for word in PRIVATE), one
    assert type(found).__name__ in text
    # a number beside its error stands in brackets
    number = getattr(found, "value", None), getattr(found, "error", None)
    if isinstance(found, Summary) and all(isinstance(one, float) for one in number):
        assert with_error(*number) in text and with_error(*number) in printed
    for name in getattr(found, "__dataclass_fields__", {}):
        one = getattr(found, name)
        if isinstance(one, Estimate) and isinstance(found, Summary) and f"\n{name} " in text:
            assert str(one) in text
    if hasattr(found, "_repr_html_"):
        page = Balanced(found._repr_html_())
        assert type(found).__name__ in page.text[0] and not any(word in "".join(page.text) for word in PRIVATE)


@pytest.mark.parametrize("name", sorted(made()))
def test_a_result_is_a_short_summary_in_plain_words(name):
    try:
        found = made()[name]()
    except InputError as refused:
        pytest.fail(f"{name}: {refused}")
    rows = found if isinstance(found, tuple) and not hasattr(found, "_fields") else (found,)
    for row in rows:
        for one in row if isinstance(row, tuple) and not hasattr(row, "_fields") else (row,):
            if not isinstance(one, np.ndarray):
                check(one)


@pytest.mark.parametrize("found", OBJECTS, ids=lambda found: type(found).__name__)
def test_what_is_computed_with_is_shown_shortly_too(found):
    if "<lambda>" not in repr(found):
        assert len(repr(found).splitlines()) <= LINES and "array(" not in repr(found)


def test_every_class_that_is_returned_is_a_summary_or_an_expression():
    plain = {name for name, kind in result_classes().items() if not issubclass(kind, Summary)}
    shown_by_themselves = {"Conditionals", "KernelMatrix", "CollisionLaw", "Table"}
    assert plain - shown_by_themselves <= EXPRESSIONS, sorted(plain - shown_by_themselves - EXPRESSIONS)


@pytest.mark.parametrize(
    "kind", sorted(summaries(), key=lambda kind: kind.__qualname__), ids=lambda kind: kind.__name__
)
def test_no_summary_has_the_wall_of_text_of_a_dataclass(kind):
    assert kind.__repr__ is Summary.__repr__ and kind._repr_html_ is Summary._repr_html_
    if is_dataclass(kind):
        for name in (*kind._show.split(), *re.findall(r"(?:^|, )\.(\w+)", kind._more)):
            assert name in kind.__dataclass_fields__ or hasattr(kind, name), f"{kind.__name__} has no {name}"


@given(st.text(max_size=20), st.dictionaries(st.text(max_size=9), st.text(max_size=20), max_size=5))
def test_every_text_is_escaped_in_a_notebook(title, facts):
    page = Balanced(html_table(title, facts))
    # a parser makes a line feed of each end of a line
    text = "".join(page.text).replace("\r\n", "\n").replace("\r", "\n")
    for one in (title, *(part for item in facts.items() if item[1] for part in item)):
        assert one.replace("\r\n", "\n").replace("\r", "\n").replace("\0", "\ufffd") in text.replace("\0", "\ufffd")


@given(st.lists(st.floats(-1e300, 1e300), max_size=60), st.integers(1, 3))
def test_an_array_is_shown_in_one_short_line(values, rows):
    array = np.array(values * rows).reshape(rows, -1)
    text = shown(array)
    assert "\n" not in text and len(text) <= 120
    if array.size > 6:
        assert f"{array.min():.6g}" in text and f"{array.max():.6g}" in text


@given(st.dictionaries(st.from_regex(r"\A[a-z]{1,9}\Z"), st.from_regex(r"\A[ -~]{1,60}\Z"), max_size=6))
def test_facts_stand_in_one_line_only_if_it_is_short(facts):
    text = text_of("Title", facts)
    assert len(text.splitlines()) == 1 if len(text) <= 120 and "\n" not in text else len(text.splitlines()) > 1
    assert all(value in text for value in facts.values())


def test_values_and_errors_of_any_shape_are_paired():
    assert with_errors(np.ones((2, 2)), 0.25) == "1.00(25), 1.00(25), 1.00(25), 1.00(25)"
    assert with_errors(np.zeros(9), np.zeros(9)).endswith("(9)")
