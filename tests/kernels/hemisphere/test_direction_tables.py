"""Tables of laws of directions beside draws of the law, their errors and files, and pictures of directions."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError

RNG = np.random.default_rng
FIELD = geo.Surface.random(geo.HeightCorrelation(0.1), 48, rms_slope=1.0, rng=2)
PLATEAUS = ker.SurfaceLaw(geo.Surface(np.kron([[0.0, 1.0], [0.0, 0.0]], np.ones((3, 3)))))
MIXED = 0.5 * ker.SurfaceLaw(FIELD) @ ker.HemisphereLaw(ker.lambertian()) + 0.5 * ker.HemisphereLaw(ker.specular())
LAWS = {"random": ker.SurfaceLaw(FIELD), "fixed": ker.SurfaceLaw(FIELD, 0.4), "mixed": MIXED, "plateaus": PLATEAUS}


def cosine(n, rng):
    """Incoming velocities of the cosine law."""
    radius, angle = np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -np.sqrt(1.0 - radius**2)])


@pytest.mark.parametrize("name", ["random", "fixed"])
def test_cells_between_quantiles_have_equally_many_rays_of_the_law(name):
    """Of N rays of the table and M others the counts vary by (1 + M/N) times the expected one."""
    law, rays, tolerance = LAWS[name], 20_000, 0.02
    table, square, p = law.table(3, 5, 5, n_turn=3, tolerance=tolerance), 0.0, []
    own = np.log(40.0 * 3 * table.turn.size) / (2.0 * tolerance**2)
    for i, t in np.ndindex(3, table.turn.size):
        square, turn = table.square[i], table.turn[t]
        down = [np.sqrt(1 - square) * np.cos(turn), np.sqrt(1 - square) * np.sin(turn), -np.sqrt(square)]
        out = law.sample(np.tile(down, (rays, 1)), RNG([i, t]))
        azimuth = (np.arctan2(out[:, 1], out[:, 0]) - turn + np.pi / 2) % (2 * np.pi) - np.pi / 2
        first = np.searchsorted(table.quantile[i, t, 1:-1], out[:, 2] ** 2)
        counts = [
            np.bincount(np.searchsorted(table.azimuth[i, t, j, 1:-1], azimuth[first == j]), minlength=4)
            for j in range(4)
        ]
        expected = rays / 16
        p.append(stats.chi2.sf(np.sum((np.array(counts) - expected) ** 2) / expected / (1 + rays / own), 15))
    assert min(p) > 1e-3 / len(p)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("sizes", [(2, 2, 2), (8, 9, 9)])
def test_mean_values_of_functions_of_slope_1_differ_from_those_of_the_law_by_less_than_the_error(name, sizes):
    law, v = LAWS[name], cosine(50_000, RNG(2))
    table = law.table(*sizes, n_turn=6, tolerance=0.04, rng=1)
    ahead = v[:, :2] / np.linalg.norm(v[:, :2], axis=1)[:, None]
    left = ahead[:, ::-1] * [-1.0, 1.0]
    values = [
        np.column_stack([
            out, np.hypot(*out[:, :2].T), np.sum(out[:, :2] * ahead, axis=1), np.sum(out[:, :2] * left, axis=1),
            np.linalg.norm(out - v * [1, 1, -1], axis=1), np.linalg.norm(out + v, axis=1),
        ])
        for out in (table.sample(v, RNG(3)), law.sample(v, RNG(4)))
    ]  # fmt: skip
    difference = values[0] - values[1]
    assert np.allclose(np.linalg.norm(table.sample(v, RNG(3)), axis=1), 1.0)
    noise = 4.0 * difference.std(axis=0) / np.sqrt(len(v))
    assert np.all(np.abs(difference.mean(axis=0)) < table.error + noise)
    # nor is it far larger where the table is coarse
    if sizes == (2, 2, 2) and name in ("mixed", "plateaus"):
        assert np.abs(difference.mean(axis=0)).max() > 0.4 * table.error


def test_the_error_of_a_fine_table_is_mostly_the_noise_of_the_rays():
    coarse, fine, more = (LAWS["random"].table(n, n, n, tolerance=tol) for n, tol in ((3, 0.02), (9, 0.04), (9, 0.02)))
    assert 0.04 < coarse.error < 0.065 and fine.error < 0.15 and more.error < 0.7 * fine.error


def test_grooves_that_reflect_back_are_exact_but_where_the_azimuth_jumps():
    """(v_x, v_y) becomes (v_x, -v_y): the azimuth changes by -2 phi, which jumps at pi/4 and 5 pi/4."""
    law = ker.HemisphereLaw(ker.retroreflection(), orientation=0.0)
    table, v = law.table(2, 3, 3, n_turn=8, tolerance=0.3), cosine(1000, RNG(0))
    clear = np.abs((np.arctan2(v[:, 1], v[:, 0]) - np.pi / 4 + np.pi / 2) % np.pi - np.pi / 2) > np.pi / 4
    assert clear.sum() > 400
    assert np.allclose(table.sample(v[clear], rng=1), v[clear] * [1, -1, -1], rtol=0.0, atol=1e-12)
    assert table.error > 0.1


def test_rare_velocities_at_the_ends_do_not_spread_the_first_and_last_interval():
    law = ker.SurfaceLaw(geo.Surface.random(geo.HeightCorrelation(0.12), 48, rms_slope=0.2, rng=2))
    table = law.table(2, 5, 5, tolerance=0.02)
    down = np.tile([np.sqrt(1 - table.square[0]), 0.0, -np.sqrt(table.square[0])], (50_000, 1))
    along = [one.sample(down, RNG(1))[:, 0].mean() for one in (table, law)]
    assert along[0] == pytest.approx(along[1], abs=0.01)


def test_the_normal_velocity_at_the_grid_is_within_the_distribution_error():
    table, v = LAWS["random"].table(2, 17, 2, tolerance=0.02, rng=3), RNG(5)
    for square, quantile in zip(table.square, table.quantile[:, 0], strict=True):
        down = np.tile([np.sqrt(1 - square), 0.0, -np.sqrt(square)], (200_000, 1))
        below = np.searchsorted(np.sort(LAWS["random"].sample(down, v)[:, 2] ** 2), quantile) / len(down)
        assert np.abs(below - table.probability).max() < table.distribution_error + 0.004
    assert 0.019 < table.distribution_error <= 0.02


def test_speeds_of_any_size_are_kept_and_draws_repeat():
    table = LAWS["plateaus"].table(2, 3, 3, tolerance=0.1)
    assert np.array_equal(table.quantile, LAWS["plateaus"].table(2, 3, 3, tolerance=0.1).quantile)
    for size in (1e200, 1.0, 1e-200):
        out = table.sample([3 * size, 0.0, -4 * size], rng=1) / size
        assert np.linalg.norm(out) == pytest.approx(5.0) and out[2] > 0.0
    assert np.array_equal(table.sample([[1.0, 2.0, -3.0]], rng=1), table.sample([[1.0, 2.0, -3.0]], RNG(1)))
    assert "error" in repr(table) and "SurfaceLaw" in repr(table)


def test_a_csv_has_the_rows_that_its_header_names_and_arrays_are_saved_by_name(tmp_path):
    table = LAWS["fixed"].table(2, 3, 4, n_turn=5, tolerance=0.1)
    lines = table.save(tmp_path / "law.csv").read_text().splitlines()
    assert "azimuths 2 pi t / 5, slices j = 0 .. 1" in lines[2] and table.law.replace('"', '\\"') in lines[0]
    numbers = np.loadtxt(lines, delimiter=",")
    assert np.array_equal(numbers[0], [0, 0, 0, 0, *table.azimuth_probability])
    rows = numbers[1:].reshape(2, 5, 2, 8)
    assert np.array_equal(rows[:, 0, 0, 0], table.square) and np.array_equal(rows[0, :, 0, 1], table.turn)
    assert np.array_equal(rows[..., 2], table.quantile[..., :-1])
    assert np.array_equal(rows[..., 3], table.quantile[..., 1:])
    assert np.array_equal(rows[..., 4:], table.azimuth)
    with np.load(table.save(tmp_path / "law.npz")) as stored:
        assert np.array_equal(stored["azimuth"], table.azimuth) and float(stored["error"]) == table.error


def test_the_sampler_on_the_page_draws_what_the_library_draws(tmp_path, monkeypatch):
    page = (Path(__file__).parents[3] / "docs" / "tables.md").read_text(encoding="utf-8")
    table, sampler = re.findall(r"^```python\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)[-2:]
    monkeypatch.chdir(tmp_path)
    names = {"geo": geo, "ker": ker, "np": np, "rng": RNG(0)}
    exec(compile(table + sampler, "tables.md", "exec"), names)
    v = 300.0 * cosine(500, RNG(1))
    read = names["read_directions"]("surface.csv", 8)
    assert np.allclose(names["reflect_in_space"](read, v, RNG(2)), names["table"].sample(v, RNG(2)), rtol=1e-9)
    assert f"{names['table'].error:.3f}" == "0.035" and "0.058, 0.035, 0.036" in page


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1, 3, 3), "n_in: expected a whole number of at least 2, got 1"),
        ((2, 3, 1), "n_azimuth: expected a whole number of at least 2, got 1"),
        ((2, 3, 3, {"n_turn": 1}), "n_turn: expected a whole number of at least 2, got 1"),
        ((2, 3, 3, {"tolerance": 1e-5}), r"tolerance: expected a number in \(0.001, 1\), got 1e-05"),
        ((100_000, 1000, 1000), "the table takes 1.6e\\+03 GB of memory"),
    ],
)
def test_sizes_and_tolerances_out_of_range_are_refused(arguments, words):
    *sizes, named = arguments if isinstance(arguments[-1], dict) else (*arguments, {})
    with pytest.raises(InputError, match=words):
        LAWS["random"].table(*sizes, **named)
    table = LAWS["plateaus"].table(2, 2, 2, tolerance=0.3)
    with pytest.raises(InputError, match="negative component along the outward normal"):
        table.sample([0.0, 0.0, 1.0])


def test_a_picture_has_the_density_over_that_of_the_cosine_law_at_the_tangential_velocity():
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    assert ker.HemisphereLaw(ker.specular()).plot([3.0, 0.3, -2.0], ax) is ax
    (cells,) = ax.collections
    density, corners = cells.get_array(), cells.get_coordinates()
    assert density.max() == density.size == density.sum()
    i, j = np.argwhere(density > 0)[0]
    own, v = corners[i : i + 2, j : j + 2].reshape(-1, 2), np.array([3.0, 0.3]) / np.linalg.norm([3.0, 0.3, -2.0])
    assert (own.min(axis=0) < v).all() and (v < own.max(axis=0)).all()
