"""Every law with a known spectrum through every tool: matrices, spectra, gaps, mixing times and enclosures."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.kernels.laws.law import Composition

EPS = float(np.finfo(float).eps)


def test_its_matrix_in_polynomials_is_diagonal(diagonal) -> None:
    law, exact = diagonal
    found = ker.discretise(law, ker.Legendre(24))
    assert np.linalg.norm(found.symmetric - np.diag(exact[:24])) <= float(found.error) + 1e-13
    assert float(found.error) < 1e-10


def test_its_largest_eigenvalues_come_with_errors_and_parities(diagonal) -> None:
    law, exact = diagonal
    found = spec.spectrum(ker.discretise(law, ker.Legendre(24)), k=6)
    assert np.all(np.diff(found.values) <= 0.0) and found.convention == law.frame
    moduli = np.sort(np.abs(found.values))[::-1]
    assert np.all(np.abs(moduli - np.sort(np.abs(exact[:24]))[::-1][:6]) <= 1e-12) and found.residuals.max() < 1e-12
    assert np.all(found.intervals[:, 0] <= found.values) and np.all(found.values <= found.intervals[:, 1])
    assert found.slem == pytest.approx(np.abs(exact[1:]).max(), abs=1e-11)
    assert found.gap == pytest.approx(1.0 - exact[1:].max(), abs=1e-11)
    theta = np.array([0.3, 1.1])
    for place, parity in enumerate(found.parity):
        sign = {"even": 1.0, "odd": -1.0}[parity]
        here, there = (found.eigenfunction(place, angle) for angle in (theta, np.pi - theta))
        assert np.allclose(there, sign * here, atol=1e-11)


@pytest.mark.slow
def test_its_gap_and_its_mixing_time_are_exact(diagonal) -> None:
    law, exact = diagonal
    gap, slem = spec.spectral_gap(law), np.abs(exact[1:]).max()
    assert abs(float(gap) - (1.0 - max(exact[1:].max(), 0.0))) <= gap.error + 1e-15
    assert gap.error < 1e-7 and gap.convention == law.frame
    assert gap.verdict in ("isolated", "essential edge")
    mixing = spec.mixing_time(law, 1e-3, "L2")
    assert abs(mixing.slem.value - slem) <= mixing.slem.error + 1e-14


@pytest.mark.parametrize("trials", [None, ker.Legendre(12), ker.Bins(32)], ids=["own", "polynomials", "steps"])
def test_its_eigenvalues_are_enclosed_with_their_indices_and_parities(diagonal, trials) -> None:
    law, exact = diagonal
    if isinstance(law, Composition):
        with pytest.raises(InputError, match="no known error"):
            spec.enclosures(law, 4, trials)
        return
    order = np.argsort(-np.abs(exact), kind="stable")
    found = spec.enclosures(law, 4, trials)
    for item in found:
        assert any(value in item for value in exact[:40])
        if item.label == "indexed":
            degree = order[item.index]
            assert exact[degree] in item and item.parity == ("odd" if degree % 2 else "even")
            # the numbers are right to a few roundings, and the intervals no wider than some dozen
            assert item.width <= 100.0 * max(abs(item.value - exact[degree]), EPS)
    assert found[0].label == "indexed"
