"""How many rays `auto` samples: as many as the tolerance needs."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker

MUSHROOMS = ker.WallLaw(geo.mushrooms(0.3, 0.5))


@pytest.mark.parametrize("basis", [ker.Legendre(2), ker.Bins(16)], ids=repr)
def test_a_rough_matrix_takes_few_rays_and_keeps_its_tolerance(basis):
    rough = ker.discretise(MUSHROOMS, basis, tolerance=1e-2)
    fine = ker.discretise(MUSHROOMS, basis, method="qmc")
    assert rough.samples < fine.samples and float(rough.error) <= 1e-2
    assert np.linalg.norm(rough.symmetric - fine.symmetric) <= 3.0 * (float(rough.error) + float(fine.error))


def test_a_look_that_finds_rays_too_few_changes_no_result():
    basis, generators = ker.Legendre(2), [np.random.default_rng(5) for _ in range(2)]
    looked = ker.discretise(MUSHROOMS, basis, tolerance=1e-8, rng=generators[0])
    asked = ker.discretise(MUSHROOMS, basis, method="qmc", rng=generators[1])
    assert looked.method == "qmc" and np.array_equal(looked.symmetric, asked.symmetric)
