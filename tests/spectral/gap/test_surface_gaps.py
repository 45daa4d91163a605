"""Gaps of surfaces: beside grooves and finer degrees; retroreflecting, level and fixed surfaces."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.gap.surfaces import kept_speeds

HEIGHTS = np.array([0.0, 0.5, 0.2, 0.9, 0.1, 0.35, 0.6, 0.15])
PROFILE = ker.WallLaw(geo.Wall.from_profile(np.arange(9) / 4.0, np.append(HEIGHTS, HEIGHTS[0]), seam="step"))
FIELD = geo.Surface.random(geo.HeightCorrelation(0.12), 48, rms_slope=0.7, rng=2)
CARTON = geo.Surface(np.add.outer([0.0, 1.0], [0.0, 1.0]) / math.sqrt(2.0))


def test_a_smooth_field_has_an_isolated_eigenvalue():
    found = spec.spectral_gap(ker.SurfaceLaw(FIELD), tolerance=1e-3)
    assert found.verdict == "isolated" and found.kind == "estimate" and found.convention == "specular"
    finer = ker.discretise(ker.SurfaceLaw(FIELD), ker.Zernike(20), samples=2**18, rng=5)
    top = np.sort(np.linalg.eigvalsh(finer.symmetric))[-2]
    assert found.error < 0.02 and abs(1.0 - top - found.value) < found.error + 0.01
    assert any("keep their tangential speed with a probability of at most 0.0" in one for one in found.evidence)


def test_grooves_of_random_direction_have_the_gap_of_their_planar_law():
    wanted = spec.spectral_gap(ker.HemisphereLaw(PROFILE), tolerance=1e-3)
    found = spec.spectral_gap(ker.SurfaceLaw(geo.Surface(HEIGHTS[:, None], 0.25)), tolerance=1e-3)
    assert abs(found.value - wanted.value) < found.error + wanted.error


def test_a_retroreflecting_surface_has_no_gap_though_its_matrix_shows_one():
    law = ker.SurfaceLaw(CARTON)
    found = spec.spectral_gap(law, tolerance=1e-2)
    assert found.verdict == "no gap" and found.value == 0.0
    assert "all of 8192 rays keep their tangential speed" in found.evidence[-1]
    matrix = ker.discretise(law, ker.Zernike(8), samples=2**17)
    assert np.sort(np.linalg.eigvalsh(matrix.symmetric))[-2] < 0.95


def test_level_ground_is_in_the_essential_spectrum():
    flat = np.zeros((4, 4))
    flat[1, 1] = -1.0
    law = ker.SurfaceLaw(geo.Surface(flat))
    kept, error, always = kept_speeds(law, np.random.default_rng(0))
    # a vertical ray meets one of the 26 level facets of 32, or one of the 6 of the pit
    assert not always and kept >= 26.0 / 32.0 - error
    found = spec.spectral_gap(law, tolerance=1e-2)
    assert found.value < 1.0 - kept + found.error + error


@pytest.mark.parametrize("orientation", ["random", 0.3])
def test_a_flat_surface_has_no_gap(orientation):
    found = spec.spectral_gap(ker.SurfaceLaw(geo.Surface([[1.0]]), orientation))
    assert (found.verdict, found.value, found.kind) == ("no gap", 0.0, "bound")


def test_at_a_fixed_orientation_grooves_have_no_gap_and_of_others_an_upper_bound_is_known():
    slanted = geo.Surface(np.subtract.outer(np.arange(4), np.arange(4)) % 4 * 0.3)
    for grooves in (geo.Surface(HEIGHTS[:, None], 0.25), slanted):
        assert spec.spectral_gap(ker.SurfaceLaw(grooves, 0.4)).verdict == "no gap"
    found = spec.spectral_gap(ker.SurfaceLaw(FIELD, 0.4), tolerance=0.3)
    assert found.verdict == "undecided" and found.value == found.error and not found.self_adjoint
    finer = ker.discretise(ker.SurfaceLaw(FIELD, 0.4), ker.Zernike(8), samples=2**18)
    norm = np.abs(np.linalg.eigvalsh((finer.symmetric * (-1.0) ** finer.basis.degrees)[1:, 1:])).max()
    assert found.value + found.error <= 1.0 - norm + finer.error.value
    carton = spec.spectral_gap(ker.SurfaceLaw(CARTON, 0.0), tolerance=0.3)
    assert carton.value + carton.error < 0.02


def test_mixtures_with_grooves_have_a_gap():
    mixed = 0.5 * ker.SurfaceLaw(FIELD) + 0.5 * ker.HemisphereLaw(ker.lambertian())
    found = spec.spectral_gap(mixed, tolerance=0.3)
    block = mixed.matrix(12, 1, samples=2**17, rng=3)
    assert abs(1.0 - np.linalg.eigvalsh(block.symmetric)[-1] - found.value) < found.error + block.error.value
