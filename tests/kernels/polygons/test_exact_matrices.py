"""Exact matrices against 40 digits: as operators they are right to 1e-13."""

from __future__ import annotations

import numpy as np
import pytest
from campaigns.judges.precise_triangular import ANGLE, BINS, reference

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.discretisation.isometry_tables import table_matrix
from asperity.kernels.walls.polygon import table_of_beams


def _closed_form(bins: ker.Bins) -> np.ndarray:
    return ker.discretise(ker.TriangularTeethLaw(ANGLE), bins).symmetric


def _beams(bins: ker.Bins) -> np.ndarray:
    vertices = geo.triangular_teeth(ANGLE).vertices
    return table_matrix(table_of_beams(beams_of(vertices)), bins)[0]


@pytest.fixture(scope="module")
def precise() -> np.ndarray:
    return reference()


@pytest.mark.parametrize("made", [_closed_form, _beams], ids=["closed form", "beams"])
def test_triangular_teeth_on_512_bins_are_right_to_1e_13_as_an_operator(made, precise) -> None:
    miss = made(ker.Bins(BINS)) - precise
    # an ulp of an end of one of 2424 masses, as a fraction of a bin: each of them less than 1e-13, together more
    assert np.abs(miss).max() < 1e-13
    assert np.linalg.norm(miss, 2) < 1.2e-13
    assert np.linalg.norm(miss) < float(ker.discretise(ker.TriangularTeethLaw(ANGLE), ker.Bins(BINS)).error)


def test_the_40_digits_of_joined_bins_are_those_of_wider_bins(precise) -> None:
    few = reference(size=16)
    # the edges of 16 bins are among those of 512, and all bins weigh the same
    joined = precise.reshape(16, BINS // 16, 16, BINS // 16).sum((1, 3)) * 16 / BINS
    assert np.abs(few - joined).max() < 1e-14
    assert np.abs(few - _closed_form(ker.Bins(16))).max() < 1e-14
