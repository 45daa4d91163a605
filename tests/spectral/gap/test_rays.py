"""Gaps by rays from graded panels, against closed forms, enclosures and other rays."""

from dataclasses import dataclass, field
from itertools import islice

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.kernels.bases.assembly import reflection_matrix
from asperity.kernels.laws.law import DrivenLaw
from asperity.spectral.bounds import rays_on_panels as module_of_panels
from asperity.spectral.bounds.quotients_by_rays import _Cells, tops_by_rays
from asperity.spectral.bounds.rays_on_panels import levels, show_another, suits_rays, values_by_rays
from asperity.spectral.essential.edge import EssentialEdge, essential_edge
from asperity.spectral.gap import gap as module
from asperity.spectral.gap import methods
from asperity.spectral.gap.gap import gap_by_rays, modulus_gap

# Eigenvalues of the arc of half angle 1.2 in both conventions, from enclosures to 1e-9.
ARC, IN_SPECULAR, LEAST = 0.3670253152, 0.311346443, -0.311346443
NO_EDGE = EssentialEdge(0.0, 0.0, "estimate", ())


def tops(law, seed, seconds, rank=np.positive):
    return [top for (top,), _ in tops_by_rays(law, np.random.default_rng(seed), seconds, rank)]


def island_wall(y=-0.12, radius=0.08):
    """A disk above a groove: rays stay for long between them."""
    groove = geo.Bezier([(0, 0), (0.3, -0.5), (0.7, -0.5), (1, 0)])
    return geo.Wall([groove], islands=[[geo.Arc((0.5, y), radius, 0.0, -2.0 * np.pi)]])


def test_errors_hold_at_every_number_of_rays():
    law, misses, number = ker.CircularArcLaw(1.2), 0, 0
    for seed in range(8):
        for top in tops(law, seed, 2.0):
            misses += abs(top.value - ARC) > top.error
            number += 1
    assert number >= 24 and misses <= 0.05 * number + 1


def test_rays_in_the_other_convention_and_by_modulus_give_the_same_eigenvalue():
    law = ker.CircularArcLaw(1.2)
    for one, rank, value in ((law.in_specular_frame(), np.positive, IN_SPECULAR), (law, np.abs, ARC)):
        last = [tops(one, seed, 1.2, rank)[-1] for seed in range(5)]
        assert sum(abs(top.value - value) <= top.error for top in last) >= 4
        assert max(top.error for top in last) < 3e-4


def test_the_spread_of_rays_in_cells_is_that_of_their_quotients():
    law = ker.CircularArcLaw(1.2)
    level = next(islice(levels(law, np.random.default_rng(5), np.positive, 2), 2, None))
    exact = level.vectors[:, :2].T @ ker.discretise(law, level.rays.basis).symmetric @ level.vectors[:, :2]
    scores = []
    for seed in range(10):
        cells = _Cells(level.rays, np.random.default_rng(seed))
        for _ in range(2):
            found = cells.next_round(level)
            scores.append((found.quotients - np.diag(exact)) / np.sqrt(found.variances))
    # twenty rounds of two functions: the mean square of the scores is one within three standard deviations
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / 40))
    assert abs(np.mean(scores)) < 3.0 / np.sqrt(40)


def test_functions_of_a_mirror_symmetric_law_are_even_or_odd_and_none_is_lost():
    law = ker.CircularArcLaw(1.2)
    level = next(islice(levels(law, np.random.default_rng(5), np.abs, 3), 2, None))
    mirrored = reflection_matrix(level.rays.basis) @ level.vectors
    assert np.allclose(mirrored, level.parities * level.vectors, atol=1e-9)
    assert np.allclose(level.vectors.T @ level.vectors, np.eye(3), atol=1e-9)
    assert set(level.parities) == {1.0, -1.0}
    # the whole spectrum of the matrix, not of one parity only
    values, _ = level._eigenpairs(level.whole)
    assert np.allclose(np.sort(values), np.linalg.eigvalsh(level.whole), atol=1e-10)


def test_rays_show_another_eigenvalue_only_above_the_known_ones(monkeypatch):
    law, asked = ker.CircularArcLaw(1.2), []
    of_rays = module_of_panels.values_by_rays
    monkeypatch.setattr(
        module_of_panels, "values_by_rays", lambda one, *how: asked.append(how[0]) or of_rays(one, *how)
    )
    assert show_another(law, 0, 0.2, True) == pytest.approx(ARC, abs=0.02)
    assert asked == [2, 3]
    # few rays are enough to show nothing
    assert show_another(law, 0, 0.4, True) is None and asked == [2, 3, 2]
    assert show_another(law, 1, ARC, True) is None


def test_the_error_decreases_with_the_rays_and_a_longer_limit_never_adds_to_it():
    law = ker.WallLaw(island_wall())
    assert suits_rays(law)
    edge = essential_edge(law)
    errors = [gap_by_rays(law, 1e-6, np.random.default_rng(0), limit, edge).error for limit in (0.4, 0.8, 1.6, 3.2)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.5 * errors[0]


def test_a_chaotic_hollow_has_its_gap_from_rays_and_another_seed_agrees():
    law = ker.WallLaw(island_wall())
    edge = essential_edge(law)
    first, second = (gap_by_rays(law, 1e-3, np.random.default_rng(seed), 4.0, edge) for seed in (1, 2))
    assert first.verdict == second.verdict == "isolated" and max(first.error, second.error) <= 1e-3
    assert abs(first.value - second.value) <= first.error + second.error
    matrix = ker.discretise(law, ker.Legendre(48), samples=2**19, method="by_sobol_rays", rng=5)
    of_matrix = spec.spectral_gap(matrix).value
    # the gap of a matrix is above the law's but for its noise
    assert -2e-3 <= of_matrix - first.value <= 1e-2


def test_a_level_that_misses_what_rays_in_bins_show_is_not_believed(monkeypatch):
    law = ker.CircularArcLaw(1.2)
    monkeypatch.setattr(module, "values_by_rays", lambda _: (np.array([0.9]), np.array([0.2])))
    gap = gap_by_rays(law, 1e-2, np.random.default_rng(0), 0.3, NO_EDGE)
    assert gap.verdict != "essential edge" and gap.value - gap.error == pytest.approx(0.0, abs=1e-15)
    assert gap.value + gap.error == pytest.approx(0.1)


def test_an_edge_that_no_panel_reaches_is_the_gap():
    edge = EssentialEdge(0.5, 0.5001, "estimate", ("as told",))
    gap = gap_by_rays(ker.CircularArcLaw(1.2), 1e-6, np.random.default_rng(0), 2.0, edge)
    assert gap.verdict == "essential edge" and gap.value == pytest.approx(0.49995) and gap.error < 1e-4
    assert "no eigenvalue beyond the edge" in " ".join(gap.evidence)


def test_rays_that_do_not_escape_are_refused():
    class Losing(DrivenLaw):
        reversible = True

        def reflect(self, x, theta):
            return np.pi - np.asarray(theta) + 0.0 * np.asarray(x)

        def reflect_with_status(self, x, theta):
            return self.reflect(x, theta), np.asarray(x) > 0.01

        def key(self):
            return ("losing",)

    with pytest.raises(AccuracyError, match="did not escape"):
        tops(Losing(), 0, 0.2)


def test_an_enclosed_gap_stays_where_rays_do_not_escape(monkeypatch):
    def lost(*_):
        raise AccuracyError("rays did not escape", 1.0)

    monkeypatch.setattr(module, "gap_by_rays", lost)
    law, rng = ker.CircularArcLaw(1.2), np.random.default_rng(0)
    enclosed = spec.spectral_gap(law, 1e-2)
    for known in (enclosed, None):
        monkeypatch.setattr(module, "enclosed_gap", lambda *_, known=known: known)
        if known is None:
            with pytest.raises(AccuracyError):
                module._by_functions(law, 1e-15, rng, 1.0, NO_EDGE)
        else:
            monkeypatch.setattr(module, "MISS_FOR_RAYS", 0.0)
            assert module._by_functions(law, 1e-15, rng, 1.0, NO_EDGE) is enclosed


def test_the_spectrum_by_rays_is_that_of_enclosures():
    law = ker.CircularArcLaw(1.2)
    sampled, known = methods._by_rays(law, 5, 1e-3, 3, 4.0), spec.spectrum(law, 5, tolerance=1e-7)
    assert np.all(np.abs(sampled.values - known.values) <= sampled.errors.total() + known.errors.total())
    assert sampled.errors.total().max() <= 2e-3 and sampled.parity == known.parity
    assert abs(sampled.gap - known.gap) <= sampled.gap_error + known.gap_error
    assert sampled.vectors.shape == (sampled.basis.size, 5)
    assert np.allclose(sampled.vectors.T @ sampled.vectors, np.eye(5), atol=1e-9)


def test_the_spectrum_of_a_chaotic_hollow_is_from_rays_and_agrees_with_a_matrix():
    law = ker.WallLaw(island_wall(-0.17, 0.13))
    found = spec.spectrum(law, 4, tolerance=2e-3)
    assert "rays from panels" in found.method
    assert found.errors.total().max() <= 2e-3 and found.verdict == "isolated"
    matrix = ker.discretise(law, ker.Legendre(48), samples=2**19, method="by_sobol_rays", rng=5)
    of_matrix = spec.spectrum(matrix, 4)
    apart = np.abs(found.values - of_matrix.values)
    assert np.all(apart <= found.errors.total() + of_matrix.errors.total()) and apart.max() < 1e-2


def test_a_lambertian_fraction_scales_what_rays_show_of_the_rest():
    rest = ker.WallLaw(island_wall())
    mixed = 0.25 * ker.lambertian() + 0.75 * rest
    for of_rest, of_mixed in zip(values_by_rays(rest), values_by_rays(mixed), strict=True):
        assert np.array_equal(of_mixed, 0.75 * of_rest)
    for gap in (spec.spectral_gap, modulus_gap):
        own, scaled = gap(rest, 4e-3 / 0.75), gap(mixed, 4e-3)
        assert scaled.value == pytest.approx(0.25 + 0.75 * own.value, abs=1e-12)
        assert scaled.error == pytest.approx(0.75 * own.error, abs=1e-12) and scaled.verdict == own.verdict


def test_a_traced_law_with_more_randomness_has_its_values_from_independent_rays():
    law = 0.5 * ker.specular() + 0.5 * ker.WallLaw(island_wall())
    assert law.random_map() is None and suits_rays(law)
    first, second = (tops(law, seed, 4.0)[-1] for seed in (0, 1))
    assert abs(first.value - second.value) <= first.error + second.error < 0.1


def test_a_law_that_cannot_be_hashed_is_refused_with_what_to_write():
    @dataclass
    class Loose(ker.Law):
        weights: np.ndarray

    @dataclass(frozen=True)
    class WithArray(ker.Law):
        weights: np.ndarray

    @dataclass(frozen=True, eq=False)
    class Advised(ker.TriangularTeethLaw):
        weights: np.ndarray = field(default_factory=lambda: np.ones(2))

    for law in (Loose, WithArray):
        law.__abstractmethods__ = frozenset()
        for call in (spec.spectral_gap, lambda one: spec.transmission(one, 1.0)):
            with pytest.raises(InputError, match=r"frozen=True.*eq=False"):
                call(law(np.ones(2)))
    assert spec.spectral_gap(Advised(0.9)).verdict == "no gap"
