"""What nested products and powers cost: every method of every kind of law ends soon, with a result or a refusal."""

import time

import numpy as np
import pytest

from asperity import InputError
from asperity import kernels as ker

THETA, EDGES = np.array([0.3, 1.0, 2.0]), np.linspace(0.0, np.pi, 9)
METHODS = {
    "sample": lambda law: law.sample(THETA, rng=0),
    "apply": lambda law: law.apply(np.cos, THETA),
    "branches": lambda law: law.branches(THETA),
    "breakpoints": lambda law: law.breakpoints(8),
    "distribution": lambda law: law.distribution(THETA, EDGES),
    "isometry_table": lambda law: law.isometry_table(),
    "expectations": lambda law: law.expectations(ker.Bins(4))(THETA, 1e-3),
    "adjoint": lambda law: law.adjoint(),
    "in_specular_frame": lambda law: law.in_specular_frame(),
    "repr": repr,
    "density_cuts": lambda law: law.density_cuts(THETA),
    "discretise": lambda law: ker.discretise(law, ker.Bins(4), tolerance=1e-2),
}
KINDS = [
    "specular", "retroreflection", "lambertian", "maxwell", "scattering", "density", "triangles", "rectangles", "arcs",
    "least resistance", "lopsided matrix", "wall in closed form", "traced wall", "sum", "product",
]  # fmt: skip
# Values of `apply`, fewer than by default, and seconds of this process for them; the first call may compile.
MOST_VALUES, LONGEST = 10**6, 20.0


@pytest.mark.parametrize("law", KINDS, indirect=True)
@pytest.mark.parametrize("exponents", [(3,), (3, 3), (2**31 - 1,)], ids=str)
def test_powers_end_soon_or_are_refused(law, exponents, monkeypatch):
    monkeypatch.setattr("asperity.kernels.laws.law.MOST_VALUES", MOST_VALUES)
    for exponent in exponents:
        law = law**exponent
    for name, method in METHODS.items():
        start = time.process_time()
        try:
            method(law)
        except InputError as reason:
            assert "expected" in str(reason) or "needs" in str(reason) or "use " in str(reason), (name, reason)
        assert time.process_time() - start < LONGEST, name


def test_the_advice_for_large_powers_works():
    law = ker.RectangularTeethLaw(2.0)
    for call in (
        lambda: ker.discretise(law ** (2**31 - 1), ker.Bins(8)),
        lambda: (law ** (2**31 - 1)).sample(THETA, rng=0),
        lambda: (ker.CircularArcLaw(1.2) ** 500).apply(np.cos, THETA),
    ):
        with pytest.raises(InputError, match="discretise"):
            call()
    power = ker.discretise(law, ker.Bins(8)) ** (2**31 - 1)
    assert np.allclose(power.array.sum(axis=1), 1.0, atol=1e-6)
