"""Ensembles: the errors of means cover the truth, mean laws, and the law of small slopes for random walls."""

import csv
import io
import re
from functools import partial

import numpy as np
import pytest

from asperity import AsperityError, Estimate, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.sweeps.ensembles import mean_estimate, spread_estimate
from asperity.spectral.sweeps.points import COLUMNS
from asperity.spectral.sweeps.running import name_of
from commands import refused, run

# Of 400 trials 95 % succeed, give or take four standard deviations.
TRIALS, LEAST, MOST = 400, 0.906, 0.994


def half_diffuse(rng):
    """Maxwell's laws with gaps uniform in [0.2, 0.8]: mean 0.5, standard deviation 0.6/sqrt(12)."""
    return ker.maxwell(np.random.default_rng(rng).uniform(0.2, 0.8))


def partly_refused(rng):
    """Gaps uniform in [0.2, 0.8], of which those above 0.5 are refused: the others have mean 0.35."""
    gap = np.random.default_rng(rng).uniform(0.2, 0.8)
    return ker.maxwell(2.0 if gap > 0.5 else gap)


def sometimes_refused(rng):
    return ker.maxwell(2.0 if rng % 4 == 0 else 0.5)


def gentle(points, slope, rng, smooth=False):
    spectrum = geo.HeightCorrelation(0.3)
    return geo.random_wall(spectrum, points, rms_slope=slope, rng=rng, smooth=smooth)


def deficit(law):
    """1 - <e_1, P e_1> in the specular convention, 4 h for small mean squared slopes h, also where there is no gap."""
    found = spec.laplacian_comparison(law, 1, 1e-5)
    return Estimate(4.0 * found.flatness, found.error, "estimate", "Legendre(2)")


@pytest.mark.parametrize(("number", "greatest"), [(8, 0.8), (24, 0.5)])
def test_errors_of_mean_and_spread_cover_the_truth_for_uniform_values(number, greatest):
    """Also of those values only that are not greater than a number, as where the other walls are refused."""
    rng, means, spreads = np.random.default_rng(number), [], []
    for _ in range(TRIALS):
        values = [value for value in rng.uniform(0.2, 0.8, number).tolist() if value <= greatest]
        mean, spread = (estimate(values, [0.0] * len(values)) for estimate in (mean_estimate, spread_estimate))
        means.append(abs(mean.value - 0.5 * (0.2 + greatest)) <= mean.error)
        spreads.append(abs(spread.value - (greatest - 0.2) / np.sqrt(12.0)) <= spread.error)
    assert LEAST <= np.mean(means) <= MOST
    assert np.mean(spreads) >= LEAST


@pytest.mark.filterwarnings("ignore:mean and spread of gap are over those that were not")
@pytest.mark.parametrize(("family", "greatest"), [(half_diffuse, 0.8), (partly_refused, 0.5)])
def test_mean_and_spread_are_those_of_the_independent_walls_that_are_not_refused(family, greatest):
    found = spec.ensemble(family, 200, rng=3)
    row, rows = found.of("gap"), found.table.rows
    gaps = [half_diffuse(wall.point["rng"]).terms[0][0] for wall in rows]
    assert [wall.value is None for wall in rows] == [gap > greatest for gap in gaps]
    values, errors = zip(*((wall.value, wall.error) for wall in rows if wall.value is not None), strict=True)
    assert values == pytest.approx([gap for gap in gaps if gap <= greatest], abs=1e-9)
    for one, estimate in ((row.mean, mean_estimate), (row.spread, spread_estimate)):
        expected = estimate(values, errors)
        assert (one.value, one.error) == (expected.value, expected.error)
        # it is not that of all walls, and does not say so
        assert one.method.endswith("realisations that were not refused, of 200") == (greatest < 0.8)
    assert (row.refused, row.realisations) == (200 - len(values), 200)
    # the walls are independent
    assert abs(row.mean.value - 0.5 * (0.2 + greatest)) <= row.mean.error
    assert abs(np.corrcoef(gaps[1:], gaps[:-1])[0, 1]) < 0.2


def test_skew_values_have_larger_errors_than_students():
    # by Student's t alone they cover 0.907
    rng = np.random.default_rng(12)
    found = [mean_estimate(rng.exponential(size=12).tolist(), [0.0] * 12) for _ in range(2000)]
    covered = np.mean([abs(one.value - 1.0) <= one.error for one in found])
    assert covered > 0.91


def test_errors_of_the_single_values_are_added():
    rng = np.random.default_rng(2)
    values = rng.normal(size=20)
    shifted, smaller = values + 0.5, 0.9 * values
    plain, wide = mean_estimate(values.tolist(), [0.0] * 20), mean_estimate(values.tolist(), [0.5] * 20)
    assert wide.error == pytest.approx(plain.error + 0.5)
    assert abs(shifted.mean() - plain.value) <= wide.error
    own = np.abs(smaller - values)
    difference = (
        spread_estimate(values.tolist(), own.tolist()).error - spread_estimate(values.tolist(), [0.0] * 20).error
    )
    assert abs(smaller.std(ddof=1) - values.std(ddof=1)) <= difference


@pytest.mark.parametrize(
    ("values", "spread"), [([0.1] * 7, 0.0), ([1 / 3, 1 / 3 + 1e-15] * 5, 0.0), ([0.1, 0.3] * 4, np.sqrt(0.08 / 7))]
)
def test_values_equal_to_rounding_have_the_spread_0_and_no_warning(values, spread):
    # of the values 0.1 and 0.3 the squared deviations are equal
    errors = [1e-3] * len(values)
    mean, found = mean_estimate(values, errors), spread_estimate(values, errors)
    assert found.value == pytest.approx(spread, abs=1e-15) and (spread > 0.0 or found.value == 0.0)
    assert mean.value == pytest.approx(np.mean(values)) and mean.error >= 1e-3
    assert spread > 0.0 or (mean.error == pytest.approx(1e-3) and found.error <= 1.1e-3)


def test_equal_values_have_no_spread_but_their_errors():
    assert spread_estimate([0.1] * 5, [0.25] * 5) == Estimate(
        np.std([0.1] * 5, ddof=1), 0.25 * np.sqrt(1.25), "estimate", "standard deviation of 5 realisations"
    )


def test_fewer_realisations_are_the_first_of_more():
    few, many = (spec.ensemble(half_diffuse, number, rng=3).table.rows for number in (5, 9))
    assert [row.value for row in few] == [row.value for row in many[:5]]
    assert len({row.value for row in many}) == 9


def test_refused_realisations_are_told_with_their_number_and_reason():
    reason = r"\d+ of 20 realisations were refused, the first because of: diffuse_fraction: expected"
    with pytest.warns(UserWarning, match=reason) as told:
        row = spec.ensemble(sometimes_refused, 20).of("gap")
    assert told[0].filename == __file__
    assert row.mean.value == 0.5 and row.mean.error < 1e-12 and 0 < row.refused < 17
    with pytest.warns(UserWarning, match=rf"mean law is that of those that were not: {reason}") as told:
        mean = spec.mean_law(sometimes_refused, 20, ker.Bins(2))
    assert told[0].filename == __file__ and f"{20 - row.refused} of 20 not refused" in mean.law
    np.testing.assert_allclose(mean.symmetric, ker.discretise(ker.maxwell(0.5), ker.Bins(2)).symmetric, atol=1e-15)


def test_three_accepted_walls_have_no_mean():
    with pytest.warns(UserWarning, match="5 of 5 realisations"):
        nothing = spec.ensemble(lambda rng: ker.maxwell(2.0), 5).of("gap")
    assert np.isnan(nothing.mean.value) and nothing.mean.error == np.inf and nothing.refused == 5
    with pytest.raises(AsperityError, match=r"5 of 5 laws were refused, that of rng=\d+ because of: diffuse_fraction"):
        spec.mean_law(lambda rng: ker.maxwell(2.0), 5, ker.Bins(2))


@pytest.mark.slow
def test_the_error_of_a_mean_law_covers_the_law():
    exact = ker.discretise(ker.maxwell(0.5), ker.Bins(4)).symmetric
    covered = []
    for trial in range(120):
        found = spec.mean_law(half_diffuse, 8, ker.Bins(4), rng=np.random.SeedSequence([trial, 2]))
        covered.append(np.linalg.norm(found.symmetric - exact) <= float(found.error))
    # of 120 trials, give or take four standard deviations
    assert np.mean(covered) >= 0.87
    assert len(found.replicates) == 8 and found.reversible and found.mirror_symmetric and found.frame == "paper"
    np.testing.assert_allclose(np.mean(found.replicates, axis=0), found.symmetric, atol=1e-15)


@pytest.mark.slow
def test_the_deficit_of_gentle_gaussian_walls_is_four_times_their_mean_squared_slope():
    pytest.importorskip("SurfaceTopography")
    ratios = []
    for slope in (0.05, 0.2):
        found = spec.ensemble(partial(gentle, 24, slope), 100, deficit, rng=4).of("deficit")
        ratios.append(Estimate(found.mean.value / (4 * slope**2), found.mean.error / (4 * slope**2), "estimate", ""))
    # the law holds to the first order in h; at a slope of 0.05 the next one is below 0.5 %
    assert abs(ratios[0].value - 1.0) <= ratios[0].error + 0.005
    # the same seeds: what they have in common is not in the difference
    assert 0.005 < ratios[0].value - ratios[1].value < 0.08


@pytest.mark.slow
def test_smooth_gaussian_walls_have_the_gap_of_small_slopes_and_polygons_none():
    pytest.importorskip("SurfaceTopography")
    seeds, quantities = {"rng": [1, 2]}, ["gap_specular", deficit]
    smooth = spec.sweep(partial(gentle, 8, 0.1, smooth=True), seeds, quantities, 4e-4)
    for gap, bound in zip(smooth.of("gap_specular"), smooth.of("deficit"), strict=True):
        assert gap.verdict == "isolated"
        # a Rayleigh quotient is no smaller than the gap, and shallow walls have Legendre's eigenfunctions
        assert 0.98 * bound.value - gap.error <= gap.value <= bound.value + bound.error + gap.error
    polygons = spec.sweep(partial(gentle, 12, 0.1), seeds, "gap_specular")
    assert [(row.value, row.verdict) for row in polygons.rows] == [(0.0, "no gap")] * 2


def test_families_with_fixed_arguments_have_the_same_name_in_every_process(tmp_path):
    family = partial(gentle, 24, 0.1)
    assert " at 0x" not in name_of(family) and "gentle" in name_of(family) and "0.1" in name_of(family)
    assert name_of(family) != name_of(partial(gentle, 24, 0.2))


def test_the_frame_has_a_line_for_each_quantity():
    pytest.importorskip("pandas")
    frame = spec.ensemble(half_diffuse, 6, ["gap", "eta"]).to_frame()
    assert list(frame["quantity"]) == ["gap", "eta"] and (frame["mean_error"] > 0.0).all()
    with pytest.raises(InputError, match="gap, eta"):
        spec.ensemble(half_diffuse, 6, ["gap", "eta"]).of("slem")


# ---- the command line -------------------------------------------------------------------------------------------
GENTLE = ["ensemble", "gaussian:length=0.3", "--points", 8, "--rms-slope", 0.1, "--walls", 6, "--tolerance", 1e-3]


def test_the_command_writes_means_and_all_walls_and_goes_on(tmp_path):
    pytest.importorskip("SurfaceTopography")
    asked = [*GENTLE, "--quantity", "resistance,gap", "--seed", 4, "--out", tmp_path]
    first = run(*asked)
    assert first.exit_code == 0, first.output
    family = partial(geo.random_wall, geo.HeightCorrelation(0.3), 8, rms_slope=0.1)
    found = spec.ensemble(family, 6, ["resistance", "gap"], 1e-3, rng=4)
    means = list(csv.DictReader(io.StringIO((tmp_path / "means.csv").read_text())))
    assert [row["quantity"] for row in means] == ["resistance", "gap"]
    assert float(means[0]["mean"]) == found.of("resistance").mean.value
    assert float(means[0]["spread_error"]) == found.of("resistance").spread.error
    assert repr(found) in first.stdout and "walls" in first.stdout and "refused" not in first.stdout
    assert found.to_csv() == (tmp_path / "means.csv").read_text()
    walls = list(csv.DictReader(io.StringIO((tmp_path / "table.csv").read_text())))
    # the columns of a sweep, with the seed that makes the wall again
    assert list(walls[0]) == ["rng", *COLUMNS]
    assert [float(row["value"]) for row in walls] == [row.value for row in found.table.rows]
    before = (tmp_path / "table.csv").read_bytes()
    assert run(*asked).exit_code == 0 and (tmp_path / "table.csv").read_bytes() == before


def test_the_command_writes_the_mean_law_and_replaces_it_by_force_only(tmp_path):
    pytest.importorskip("SurfaceTopography")
    first = run(*GENTLE, "--bins", 4, "--out", tmp_path)
    assert first.exit_code == 0, first.output
    family = partial(geo.random_wall, geo.HeightCorrelation(0.3), 8, rms_slope=0.1)
    known, found = spec.mean_law(family, 6, ker.Bins(4), 1e-3, rng=0), ker.load_matrix(tmp_path / "mean-law.npz")
    assert np.array_equal(found.symmetric, known.symmetric) and found.error == known.error
    other = [*GENTLE, "--bins", 5, "--out", tmp_path]
    refused = run(*other)
    assert refused.exit_code == 1 and re.search(r"basis: 'Bins\(4\) .* there, 'Bins\(5\) .* here", refused.stderr)
    assert run(*other, "--force").exit_code == 0 and ker.load_matrix(tmp_path / "mean-law.npz").basis == ker.Bins(5)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (["--rms-slope", 0.2], "Differences: family"),
        (["--seed", 1], "Differences: first wall"),
        (["--walls", 7], "grid.rng"),
        (["--rms-height", 0.2], "expected one of rms_slope and rms_height"),
    ],
)
def test_the_folder_of_another_ensemble_is_refused_with_the_difference(changed, words, tmp_path):
    pytest.importorskip("SurfaceTopography")
    assert run(*GENTLE, "--out", tmp_path).exit_code == 0
    found = run(*GENTLE, *changed, "--out", tmp_path)
    assert found.exit_code == 1 and words in found.stderr
    if words.startswith("Diff"):
        assert run(*GENTLE, *changed, "--out", tmp_path, "--force").exit_code == 0


@pytest.mark.parametrize(
    "spectrum",
    ["gaussian", "gaussian:length=short", "white:length=1", "gaussian:length=1,length=2", "self-affine:longest=1",
     "gaussian:hurst=0.5"],
)  # fmt: skip
def test_other_spectra_are_refused_with_those_that_there_are(spectrum, tmp_path):
    words = refused("ensemble", spectrum, "--rms-slope", 0.1, "--out", tmp_path / "a")
    assert "self-affine:hurst=NUMBER,longest=NUMBER" in words
    assert not (tmp_path / "a").exists()
