"""Wrong kinds of arguments: no call crashes, goes on and on or answers NaN.

Constructors and the functions of the first pages answer with an InputError, others also as Python does.
"""

import contextlib
import inspect
import signal
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from campaigns.cases.public_calls import CALLS, EDGES, FIRST, LEFT_OUT, PLAIN, is_strict, wrong_kinds
from campaigns.faults.odd_arguments import has_nan, leaves

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AsperityError, InputError

# Seconds of the processor that a call may take: one that takes its argument may work.
LONGEST = 10.0


class TooLong(BaseException):
    """A call goes on and on."""


def call(function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    def stop(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
    try:
        return function(**arguments)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def test_every_public_callable_is_called_or_left_out_for_a_reason():
    public = {name for room in (geo, ker, spec) for name in room.__all__ if callable(getattr(room, name))}
    assert public - LEFT_OUT == {name for name in CALLS if "." not in name and name not in ("Estimate", "study_wall")}
    assert public >= LEFT_OUT
    for function, arguments in CALLS.values():
        inspect.signature(function).bind(**arguments)


def test_the_functions_of_the_first_pages_are_called():
    assert set(CALLS) >= FIRST


@pytest.mark.parametrize("theta", [np.array([1, 2]), np.array([1], dtype=np.int8)], ids=["int64", "int8"])
def test_whole_angles_reach_the_compiled_march_as_doubles(theta):
    # the march takes doubles by their address: other numbers were read beyond their end
    law = ker.WallLaw(geo.elliptical_arcs(1.0))
    whole, doubles = (law.conditionals(given, degree=0, edges=EDGES) for given in (theta, theta.astype(np.float64)))
    np.testing.assert_array_equal(whole.nodes, doubles.nodes)


def test_edges_of_a_wrong_shape_do_not_reach_the_compiled_march():
    with pytest.raises(InputError, match="edges"):
        ker.WallLaw(geo.elliptical_arcs(1.0)).conditionals(np.array([1.0]), edges=np.ones((4, 3, 2)))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_kind_of_argument_is_refused(name, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    monkeypatch.chdir(tmp_path)
    function, arguments = CALLS[name]
    allowed = AsperityError if is_strict(name, function) else (AsperityError, *PLAIN)
    defaults = {one: parameter.default for one, parameter in inspect.signature(function).parameters.items()}
    raised = []
    # compiles what is needed, which takes longer than a call may
    usual = None
    with contextlib.suppress(AsperityError):
        usual = function(**arguments)
    for changed in arguments:
        for kind, wrong in wrong_kinds(name, changed).items():
            if any(wrong is good for good in (arguments[changed], defaults.get(changed, inspect.Parameter.empty))):
                continue
            try:
                answer = call(function, {**arguments, changed: wrong})
                if kind != "nan" and has_nan(leaves(answer)) and not has_nan(leaves(usual)):
                    raised.append(f"{changed} = {kind}: NaN")
            except allowed as refusal:
                if not str(refusal):
                    raised.append(f"{changed} = {kind}: {type(refusal).__name__} without words")
            except (Exception, TooLong) as other:
                raised.append(f"{changed} = {kind}: {type(other).__name__}: {str(other)[:90]}")
            pyplot.close("all")
    assert not raised, "\n".join(raised)
