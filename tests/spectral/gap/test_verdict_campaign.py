"""Verdicts, spectra to a tolerance, powers, and laws that are not self-adjoint: beside `campaigns.spectra.verdicts`."""

from dataclasses import replace

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import random_curved_wall
from campaigns.spectra import verdicts

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError
from asperity.kernels.laws.law import Composition
from asperity.spectral.bounds.contraction import self_adjoint_elsewhere
from asperity.spectral.eigenvalues.spectra import matrix_spectrum
from asperity.spectral.essential.edge import straight_part
from asperity.spectral.gap.refinement import Refinement
from commands import run

ARC = ker.CircularArcLaw(1.2)
SKEW = ker.WallLaw(geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.7, -0.5), (1, 0)])]))
ARROW = ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (1, 0)]))


@pytest.mark.slow
@pytest.mark.parametrize("wall", [random_curved_wall(11), verdicts.island_wall(0)], ids=["mixed", "island"])
def test_the_straight_part_reaches_as_far_as_straight_rays_of_the_textbook(wall):
    """A matrix of these rays reaches a little less far, the root of (Q^m 1) a little farther."""
    low, high = verdicts.straight_edge(wall)
    found = straight_part(ker.WallLaw(wall))
    assert low - 6e-3 <= found.low <= found.high <= high + 6e-3
    assert found.high - found.low < 8e-3


def test_an_island_of_segments_has_a_straight_part():
    bowl = geo.Bezier([(0, 0), (0.1, -0.9), (0.9, -0.9), (1, 0)])
    corners = [(0.4, -0.3), (0.5, -0.2), (0.6, -0.3), (0.5, -0.4)]
    island = [geo.Segment(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    found = straight_part(ker.WallLaw(geo.Wall([bowl], islands=[island])))
    # rays from above that the upper sides send away at once
    assert 0.05 < found.fraction < found.low <= found.high < 1.0


def test_changes_that_shrink_lead_beyond_an_edge_or_not():
    def steps(*tops):
        level = matrix_spectrum(ker.discretise(ker.maxwell(0.5), ker.Legendre(4)), 3)
        return Refinement(tuple(replace(level, gap=1.0 - top) for top in tops), False, ())

    assert steps(0.5, 0.6, 0.65).overshoot(0.69) == pytest.approx(0.01)
    assert steps(0.5, 0.6, 0.65).overshoot(0.71) == 0.0
    assert steps(0.5, 0.6).overshoot(0.69) == pytest.approx(0.01)
    # towards an edge at grazing changes hardly shrink, and a last one that is noise tells nothing
    assert steps(0.5, 0.6, 0.69).overshoot(0.7) == steps(0.5, 0.6, 0.6).overshoot(0.5) == 0.0


def test_one_segment_among_curves_reaches_as_far_as_its_best_pair_of_angles():
    """One reflection turns theta to c - theta and back: the top is sup (q(theta) q(c - theta))^(1/2)."""
    wall = geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.3, -0.6)]), geo.Segment((0.3, -0.6), (1, 0))])
    law = ker.WallLaw(wall)
    slope = np.arctan2(0.6, 0.7)
    # a ray that enters at x with the angle theta goes down along -(cos, sin): it hits the segment first, or never
    theta = np.linspace(0.01, np.pi - 0.01, 400)
    x = (np.arange(4000) + 0.5) / 4000

    def fraction(angle):
        out, _ = law.reflect_with_status(x[None, :], angle[:, None])
        traced = geo.trace(wall, np.broadcast_to(x, out.shape), np.broadcast_to(angle[:, None], out.shape))
        mirrored = np.abs(out - (np.pi + 2.0 * slope - angle)[:, None]) < 1e-9
        return np.mean(mirrored & (traced.collisions == 1), axis=1)

    back = np.pi + 2.0 * slope - theta
    inside = (back > 0.0) & (back < np.pi)
    expected = np.sqrt(fraction(theta[inside]) * fraction(back[inside])).max()
    found = straight_part(law)
    assert found.low - 2e-3 <= expected <= found.high + 1e-3


@pytest.mark.parametrize(
    ("verdict", "gap", "stands"),
    [
        ("essential edge", 0.16, True), ("essential edge", 0.05, False), ("essential edge", 0.3, False),
        ("isolated", 0.163, True), ("isolated", 0.05, False), ("isolated", 0.3, False), ("no gap", 0.0, False),
    ],
)  # fmt: skip
def test_the_judge_of_verdicts_refutes_wrong_gaps_and_edges(verdict, gap, stands):
    found = spec.SpectralGap(gap, 1e-4, "estimate", "", verdict, (), "paper")
    known, edge = (np.array([0.82, 0.83, 0.835]), 1e-3), (0.83, 0.85)
    assert (verdicts.refutation(found, known, edge) == "") is stands


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8])
def test_a_spectrum_has_the_digits_that_are_asked_for(tolerance):
    """Facts 10: 0.3670253152(3)."""
    found = spec.spectrum(ARC, 2, tolerance=tolerance)
    assert found.errors.total().max() <= tolerance
    assert abs(found.values[1] - 0.3670253152) <= found.errors.total()[1] + 3e-10
    assert found.verdict == "isolated" and found.gap == 1.0 - found.values[1]
    # not more than is asked for either
    assert found.errors.total()[1] > 1e-4 * tolerance


def test_the_spectrum_of_a_law_carries_its_verdict():
    teeth = spec.spectrum(ker.TriangularTeethLaw(0.7), 4)
    assert (teeth.verdict, teeth.gap, teeth.slem, teeth.gap_error) == ("no gap", 0.0, 1.0, 0.0)
    assert "no gap" in repr(teeth) and teeth.evidence
    semicircle = spec.spectrum(ker.CircularArcLaw(np.pi / 2), 3, tolerance=1e-3)
    assert semicircle.verdict == "essential edge" and abs(semicircle.slem - 3 / 8 * np.log(9)) <= semicircle.gap_error
    matrix = spec.spectrum(ker.discretise(ARC, ker.Bins(8)), 3)
    assert matrix.verdict == "undecided" and matrix.gap == 1.0 - matrix.values[1]


@pytest.mark.slow
@pytest.mark.parametrize("law", [ARC @ ARC, ARC**3, ker.henyey_greenstein(-0.7) ** 2], ids=str)
def test_eigenvalues_of_powers_are_powers(law):
    base, exponent = (law.laws[0], 2) if isinstance(law, Composition) else (law.law, law.exponent)
    plain = spec.spectrum(base, 3, tolerance=1e-6)
    found = spec.spectrum(law, 3, tolerance=1e-4)
    expected = np.sort(plain.values[1:] ** exponent)[::-1]
    assert np.all(np.abs(found.values[1:] - expected) <= found.errors.total()[1:] + 1e-6)
    assert found.errors.total().max() <= 1e-4 and np.all(np.diff(found.values) <= 0.0)
    assert abs(found.slem - plain.slem**exponent) <= 1e-4
    assert abs(found.gap - (1.0 - expected[0])) <= found.gap_error + 1e-6
    for item, value in zip(spec.enclosures(law, 3, tolerance=1e-4), [1.0, *expected], strict=True):
        assert item.low - 1e-6 <= value <= item.high + 1e-6 and item.label == "indexed"


def test_a_wall_without_mirror_axis_says_at_once_that_it_is_not_self_adjoint():
    for law in (SKEW, ARROW, 0.3 * ker.lambertian() + 0.7 * SKEW):
        turned = law.in_specular_frame()
        assert self_adjoint_elsewhere(turned) == law
        for ask in (spec.spectrum, spec.enclosures):
            with pytest.raises(AccuracyError, match="slem"):
                ask(turned, 3)
    gap = spec.spectral_gap(ARROW.in_specular_frame())
    assert (gap.verdict, gap.value, gap.error, gap.self_adjoint) == ("no gap", 0.0, 0.0, False)
    assert "not known to be self-adjoint" in gap.evidence[0] and "||P J f|| <= slem ||f||" in gap.evidence[1]
    assert ker.CircularArcLaw(1.2).in_specular_frame().reversible and spec.spectral_gap(ker.maxwell(0.5)).self_adjoint


def test_the_contraction_factor_is_the_largest_singular_value_off_the_constants():
    gap = spec.spectral_gap(SKEW.in_specular_frame(), tolerance=1e-3)
    matrix = ker.discretise(SKEW, ker.Legendre(12), method="qmc", samples=2**16)
    largest = np.linalg.svd(matrix.in_specular_frame().array[1:, 1:])[1][0]
    assert not gap.self_adjoint and gap.convention == "specular" and gap.verdict == "isolated"
    assert abs(1.0 - gap.value - largest) <= gap.error + 5e-3
    assert abs(matrix_spectrum(matrix, 4).slem - largest) <= 5e-3


def test_the_command_line_says_so_too(tmp_path):
    path = tmp_path / "skew.toml"
    ARROW.wall.save(path)
    done = run("gap", path, "--specular", "--enclose", 2)
    assert done.exit_code == 0
    assert done.output.startswith("not known to be self-adjoint, 1 - norm on functions of mean 0: 0 ")
    assert "not known to be self-adjoint" in done.output and "enclosures refused" in done.output
