"""Tables of inverse distribution functions: exact cases, their errors, files, and what is drawn from them."""

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ks_2samp

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import FileExistsRefusal, InputError

LAWS = [
    ker.lambertian(),
    ker.maxwell(0.25),
    ker.TriangularTeethLaw(0.7),
    ker.CircularArcLaw(1.2),
    ker.RectangularTeethLaw(1.0),
    ker.WallLaw(geo.dispersing_arcs(0.8)),
    ker.henyey_greenstein(0.5),
    ker.lambertian() @ ker.TriangularTeethLaw(0.7),
    ker.CircularArcLaw(0.8).in_specular_frame(),
]


def transport_distance(first, second):
    """The mean distance of two samples of equal size, matched in order."""
    return float(np.abs(np.sort(first) - np.sort(second)).mean())


def test_quantiles_of_the_lambertian_law_are_those_of_the_invariant_measure():
    table = ker.lambertian().table(3, 33)
    assert np.allclose(table.quantile, ker.SINE.quantile(table.probability), atol=1e-5)
    assert table.theta.tolist() == pytest.approx([np.pi / 6, np.pi / 2, 5 * np.pi / 6])
    assert np.all(np.diff(table.quantile, axis=1) > 0.0)


def test_the_error_of_the_lambertian_law_is_that_of_linear_interpolation():
    table = ker.lambertian().table(4, 17)
    p = (np.arange(10**5) + 0.5) / 10**5
    drawn = np.interp(p, table.probability, ker.SINE.quantile(table.probability))
    assert table.error == pytest.approx(np.abs(drawn - ker.SINE.quantile(p)).mean(), rel=0.05)
    assert table.largest_error == pytest.approx(np.abs(drawn - ker.SINE.quantile(p)).max(), rel=0.3)


@pytest.mark.parametrize("law", [ker.specular(), ker.retroreflection()], ids=repr)
@pytest.mark.parametrize("theta", [1e-6, 0.3, 1.5, 3.14])
def test_reflections_are_exact_at_every_angle(law, theta):
    table = law.table(5, 3)
    assert table.sample(theta, np.random.default_rng(0)) == pytest.approx(law.sample(theta), abs=1e-14)
    assert table.error < 1e-15 and table.distribution_error == 0.0


def test_quantiles_of_a_mixture_stay_at_its_atom_for_the_weight_of_it():
    table = (0.5 * ker.specular() + 0.5 * ker.lambertian()).table(8, 401)
    for angle, quantile in zip(table.theta, table.quantile, strict=True):
        assert np.mean(np.abs(quantile - (np.pi - angle)) < 1e-12) == pytest.approx(0.5, abs=2 / 401)


@pytest.mark.parametrize("turned", [False, True])
def test_quantiles_of_a_traced_wall_stay_at_the_angle_of_its_flat_tops(turned):
    law = ker.WallLaw(geo.mushrooms())
    flat = law.wall.flat_top / law.wall.period
    table = (law.in_specular_frame() if turned else law).table(6, 1001)
    assert 0.2 < flat < 0.9
    for angle, quantile in zip(table.theta, table.quantile, strict=True):
        specular = angle if turned else np.pi - angle
        assert np.mean(np.abs(quantile - specular) < 1e-12) == pytest.approx(flat, abs=2 / 1001)


def test_jumps_do_not_shrink_and_the_mean_error_does():
    coarse, fine = (ker.TriangularTeethLaw(0.7).table(n, n) for n in (16, 64))
    assert fine.error < 0.4 * coarse.error
    assert fine.largest_error > 0.5


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_drawn_angles_agree_with_the_law_within_the_error(law):
    table = law.table(24, 25)
    rng = np.random.default_rng(5)
    distances = []
    # neither on the grid nor in the middle of its cells
    angles = (np.arange(0, 24, 3) + 0.75) * np.pi / 24
    for theta in angles:
        incoming = np.full(20_000, theta)
        distances.append(transport_distance(table.sample(incoming, rng), law.sample(incoming, rng)))
    mean = np.average(distances, weights=np.sin(angles))
    assert mean < 1.5 * table.error + 0.02
    assert table.quantile.min() > 0.0 and table.quantile.max() < np.pi


def test_draws_from_a_table_take_a_seed_by_name_and_repeat():
    table = ker.maxwell(0.5).table(8, 9)
    assert np.array_equal(table.sample([0.5, 1.0], rng=1), table.sample([0.5, 1.0], np.random.default_rng(1)))
    assert table.sample(1.0, rng=1).shape == ()
    with pytest.raises(InputError, match="theta"):
        table.sample(0.0)


def test_a_csv_is_read_by_numpy_and_states_units_and_convention(tmp_path):
    table = ker.maxwell(0.25).in_specular_frame().table(6, 5)
    path = table.save(tmp_path / "law.csv")
    numbers = np.loadtxt(path, delimiter=",")
    assert np.array_equal(numbers[0, 1:], table.probability) and numbers[0, 0] == 0.0
    assert np.array_equal(numbers[1:, 0], table.theta) and np.array_equal(numbers[1:, 1:], table.quantile)
    header = [line for line in path.read_text().splitlines() if line.startswith("#")]
    for words in ("radians", "convention: specular; theta_out = theta_in is specular", "rows: theta_in", "error"):
        assert any(words in line for line in header), words


def test_an_npz_has_every_attribute(tmp_path):
    table = ker.CircularArcLaw(1.2).table(4, 5)
    with np.load(table.save(tmp_path / "law.npz")) as stored:
        for name in ("theta", "probability", "quantile", "error", "largest_error", "distribution_error"):
            assert np.array_equal(stored[name], getattr(table, name)), name
        assert str(stored["frame"]) == "paper" and "radians" in str(stored["header"])


def test_an_hdf5_file_has_every_attribute(tmp_path):
    h5py = pytest.importorskip("h5py")
    table = ker.CircularArcLaw(1.2).in_specular_frame().table(4, 5)
    with h5py.File(table.save(tmp_path / "law.h5"), "r") as stored:
        for name in ("theta", "probability", "quantile"):
            assert np.array_equal(stored[name][:], getattr(table, name)), name
        for name in ("error", "largest_error", "distribution_error", "frame", "law"):
            assert stored.attrs[name] == getattr(table, name), name
        assert "radians" in stored.attrs["header"]


def test_without_h5py_the_message_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"asperity\[hdf5\]"):
        ker.lambertian().table(2, 2).save(tmp_path / "law.h5")
    assert not list(tmp_path.iterdir())


def test_files_are_replaced_on_request_only_and_other_formats_are_refused(tmp_path):
    table = ker.lambertian().table(2, 2)
    names = ["law.csv", "law.npz"] + ["law.h5"] * (find_spec("h5py") is not None)
    for name in names:
        path = table.save(tmp_path / name)
        before = path.read_bytes()
        with pytest.raises(FileExistsRefusal):
            table.save(path)
        assert path.read_bytes() == before and table.save(path, overwrite=True) == path
    for name in ("law.hdf5", "law", "law.txt"):
        with pytest.raises(InputError, match=r"ends in \.csv, \.npz or \.h5"):
            table.save(tmp_path / name)
    assert sorted(path.name for path in Path(tmp_path).iterdir()) == sorted(names)


def test_the_error_of_a_law_that_does_not_know_it_is_found_by_drawing():
    table = (ker.henyey_greenstein(0.5) @ ker.TriangularTeethLaw(0.7)).table(4, 4)
    assert 1e-4 < table.distribution_error < 0.02 and 0.0 < table.error < 1.0


def test_a_table_of_a_measured_profile_says_that_it_misses_the_tolerance_and_by_how_much(tmp_path):
    rng = np.random.default_rng(7)
    height = 0.02 * np.cumsum(rng.normal(size=2000))
    law = ker.WallLaw(geo.Wall.from_profile(np.linspace(0.0, 10.0, 2000), height - height.mean()))
    table = law.table(2, 9)
    assert 1e-4 < table.distribution_error < 0.03
    assert "(above the tolerance)" in repr(table) and "above" not in repr(ker.lambertian().table(2, 3))
    assert any("(above the tolerance), 0.0001 wanted" in line for line in table._header())
    for theta, quantile in zip(table.theta, table.quantile, strict=True):
        drawn = np.sort(law.reflect_with_status(rng.random(200_000), np.full(200_000, theta))[0])
        off = np.searchsorted(drawn, quantile[1:-1]) / drawn.size - table.probability[1:-1]
        # the quantiles are those between cells of angles
        assert np.abs(off).max() < table.distribution_error + 0.01


CLIENTS = Path(__file__).parents[3] / "docs" / "clients"
PAGE = (Path(__file__).parents[3] / "docs" / "tables.md").read_text(encoding="utf-8")


def block_of(language, number=0):
    return re.findall(rf"^```{re.escape(language)}\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE)[number]


def assert_angles_of(law, table, theta, drawn):
    """Mean, second moment and distribution of angles from a sampler, against the law and exact draws from the table."""
    assert drawn.min() > 0.0 and drawn.max() < np.pi
    for function in (np.cos, np.sin, lambda angle: np.cos(2.0 * angle)):
        deviation = abs(function(drawn).mean() - float(law.apply(function, theta)))
        assert deviation < table.largest_error + table.distribution_error + 5.0 / np.sqrt(drawn.size)
    # Kolmogorov and Smirnov's distance to quantiles of the table; 2.0 / sqrt(n) is exceeded with probability 0.0007
    p = (np.arange(4000) + 0.5) / 4000
    quantile = np.sort(table._at(np.full(p.shape, theta), p))
    distribution = np.searchsorted(np.sort(drawn), quantile) / drawn.size
    assert np.abs(distribution - p).max() < 2.0 / np.sqrt(drawn.size) + 1.0 / p.size


def test_the_sampler_in_numpy_on_the_page_draws_from_the_law(tmp_path, monkeypatch):
    law, theta = ker.CircularArcLaw(1.2), 1.3
    table = law.table(24, 25)
    table.save(tmp_path / "law.csv")
    monkeypatch.chdir(tmp_path)
    names = {"law": law}
    exec(compile(block_of("python", 1), "tables.md", "exec"), names)
    drawn = names["sample"](names["read_table"]("law.csv"), np.full(50_000, theta), np.random.default_rng(4))
    assert_angles_of(law, table, theta, drawn)
    # at grazing angles too it does as the table does
    grazing = np.array([1e-9, 0.01, 3.1, np.pi - 1e-9])
    own = names["sample"](table.quantile, grazing, np.random.default_rng(7))
    assert np.array_equal(own, table.sample(grazing, np.random.default_rng(7)))


STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{CLIENTS}"]
COMPILERS = {
    "c++": ("g++", ".cpp", ["-std=c++17", *STRICT]),
    # the standard that SPARTA is compiled with
    "c++11": ("g++", ".cpp", ["-std=c++11", *STRICT]),
    "fortran": ("gfortran", ".f90", ["-std=f2008", "-Wall"]),
}


def compiled(language, text, folder):
    """Numbers that the program of this text prints, given its arguments and its input."""
    compiler, suffix, flags = COMPILERS[language]
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    source, program = folder / f"sample{suffix}", folder / "sample"
    source.write_text(text)
    subprocess.run([compiler, "-O2", *flags, str(source), "-o", str(program), "-lm"], check=True, cwd=folder)

    def run(*arguments, given=""):
        command = [str(program), str(folder / "law.csv"), *map(str, arguments)]
        done = subprocess.run(command, input=given, check=True, capture_output=True, text=True)
        return np.array(done.stdout.split(), dtype=np.float64)

    return run


@pytest.mark.parametrize(("language", "sizes"), [("c++", []), ("fortran", [24, 25])])
def test_the_compiled_samplers_on_the_page_draw_from_the_law(language, sizes, tmp_path):
    run, law, rows = compiled(language, block_of(language), tmp_path), ker.CircularArcLaw(1.2), 20_000
    table = law.table(24, 25)
    table.save(tmp_path / "law.csv")
    for theta in (0.05, 1.3, 3.1):
        drawn = run(*sizes, theta, rows)
        assert drawn.size == rows
        assert_angles_of(law, table, theta, drawn)


def lopsided(theta, theta_out):
    """A reversible density that is not mirror-symmetric: the sides of the grooves differ."""
    raised, raised_out = np.sin(theta) - np.pi / 4, np.sin(theta_out) - np.pi / 4
    return 0.5 * np.sin(theta_out) * (1.0 + 0.6 * (np.cos(theta) * raised_out + raised * np.cos(theta_out)))


LOPSIDED = ker.DensityLaw(lopsided)
# across grooves of either direction the first comes obliquely, the second nearly along them
VELOCITIES = np.repeat([[2.0, -1.0, -1.5], [-0.5, 3.0, -0.4]], 20_000, axis=0)


def assert_velocities_of(law, orientation, drawn):
    """Speed, what grooves keep, means and distributions of velocities from a sampler, against the law in space."""
    own = ker.HemisphereLaw(law, orientation).sample(VELOCITIES, np.random.default_rng(21))
    assert drawn.shape == own.shape and drawn[:, 2].min() > 0.0
    assert np.allclose(np.linalg.norm(drawn, axis=1), np.linalg.norm(VELOCITIES, axis=1), rtol=1e-12)
    if orientation != "random":
        along = np.array([np.cos(orientation), np.sin(orientation), 0.0])
        assert np.allclose(drawn @ along, VELOCITIES @ along, atol=1e-12)
    for half in (slice(20_000), slice(20_000, None)):
        for one, other in zip(drawn[half].T, own[half].T, strict=True):
            assert abs(one.mean() - other.mean()) < 5.0 * np.sqrt((one.var() + other.var()) / 20_000) + 0.01
            # two samples; 2.0 sqrt(2 / n) is exceeded with probability 0.0007, and the table adds its error
            assert ks_2samp(one, other).statistic < 2.0 * np.sqrt(2.0 / 20_000) + 0.01


@pytest.mark.parametrize("orientation", ["random", 0.4])
def test_the_sampler_in_space_in_numpy_draws_from_the_law(orientation, tmp_path, monkeypatch):
    LOPSIDED.table(64, 65).save(tmp_path / "law.csv")
    monkeypatch.chdir(tmp_path)
    names = {"law": LOPSIDED}
    exec(compile(block_of("python", 1) + block_of("python", 2), "tables.md", "exec"), names)
    angle = None if orientation == "random" else orientation
    drawn = names["reflect"](names["read_table"]("law.csv"), VELOCITIES, np.random.default_rng(3), angle)
    assert_velocities_of(LOPSIDED, orientation, drawn)


FORTRAN_MAIN = """
program draw
  use tables
  implicit none
  real(dp), allocatable :: quantile(:, :)
  character(1000) :: path, text
  real(dp) :: v(3), phi, angle, u
  integer :: unit
  call get_command_argument(1, path)
  call get_command_argument(2, text)
  read (text, *) phi
  call read_table(trim(path), 64, 65, quantile)
  do
    read (*, *, iostat=unit) v
    if (unit /= 0) exit
    angle = phi
    if (phi < 0) then
      call random_number(angle)
      angle = 2*pi*angle
    end if
    call random_number(u)
    call reflect(quantile, v, angle, u)
    print "(3es26.17)", v
  end do
end program draw
"""


def test_the_sampler_in_space_in_fortran_draws_from_the_law(tmp_path):
    plain, added = block_of("fortran"), block_of("fortran", 1)
    head = plain[: plain.index("end module tables")]
    run = compiled("fortran", head + added + "end module tables\n" + FORTRAN_MAIN, tmp_path)
    LOPSIDED.table(64, 65).save(tmp_path / "law.csv")
    given = "\n".join(" ".join(map(repr, row)) for row in VELOCITIES.tolist())
    for orientation in ("random", 0.4):
        drawn = run(-1.0 if orientation == "random" else orientation, given=given)
        assert_velocities_of(LOPSIDED, orientation, drawn.reshape(-1, 3))


CPP_MAIN = """
#include "asperity_table.hpp"
#include <cstdio>
#include <cstring>

// Angles for lines with theta and u, or velocities for lines with v, phi, u and w; prints an error and ends with 1.
int main(int, char** argv) {
    try {
        const asperity::Table law(argv[1]);
        double v[3], phi, u, w;
        if (!std::strcmp(argv[2], "angles"))
            while (std::scanf("%lf %lf", v, &u) == 2) std::printf("%.17g ", law.sample(v[0], u));
        else
            while (std::scanf("%lf %lf %lf %lf %lf %lf", v, v + 1, v + 2, &phi, &u, &w) == 6) {
                law.reflect(v, phi, u, w);
                std::printf("%.17g %.17g %.17g ", v[0], v[1], v[2]);
            }
    } catch (const std::exception& problem) {
        std::fputs(problem.what(), stderr);
        return 1;
    }
}
"""


@pytest.fixture(scope="module")
def header(tmp_path_factory):
    """A program that draws by the C++ header what it reads, from the table law.csv in a folder."""
    folder = tmp_path_factory.mktemp("header")
    return folder, compiled("c++11", CPP_MAIN, folder)


def lines_of(*columns):
    """Numbers as the programs read them."""
    return "\n".join(" ".join(map(repr, row)) for row in np.column_stack(columns).tolist())


@pytest.mark.parametrize("law", [ker.CircularArcLaw(1.2), LOPSIDED, LOPSIDED.in_specular_frame()], ids=repr)
def test_the_header_draws_the_angles_of_the_table(law, header):
    (folder, run), table = header, law.table(24, 25)
    table.save(folder / "law.csv", overwrite=True)
    theta = np.concatenate([np.linspace(0.001, 3.141, 500), [1e-300, 1e-9, np.nextafter(np.pi, 0.0)]])
    u = np.random.default_rng(1).random(theta.size)
    found = run("angles", given=lines_of(theta, u))
    assert np.allclose(found, table.sample(theta, np.random.default_rng(1)), rtol=1e-13, atol=1e-15)


def velocities(count, speed=300.0):
    """Incoming velocities of a gas, and an angle and two numbers for each."""
    rng = np.random.default_rng(2)
    return speed * rng.normal(size=(count, 3)) * [1, 1, 0] - [0, 0, speed] * rng.random((count, 1)), rng.random(
        (2, count)
    )


@pytest.mark.parametrize("law", [LOPSIDED, LOPSIDED.in_specular_frame()], ids=repr)
@pytest.mark.parametrize("phi", [0.0, 2.5])
def test_the_header_reflects_across_grooves_as_the_table_does(law, phi, header):
    (folder, run), table = header, law.table(24, 25)
    table.save(folder / "law.csv", overwrite=True)
    v, (u, w) = velocities(300)
    found = run("velocities", given=lines_of(v, np.full(300, phi), u, w)).reshape(-1, 3)
    # grooves have the direction g, and the law's x axis is that of g x normal
    g, normal = np.array([np.cos(phi), np.sin(phi), 0.0]), np.array([0.0, 0.0, 1.0])
    across = np.cross(g, normal)
    angle = table._at(np.arctan2(-v @ normal, -v @ across), u)
    angle = np.pi - angle if table.frame == "specular" else angle
    size = np.linalg.norm(v - np.outer(v @ g, g), axis=1)[:, None]
    own = np.outer(v @ g, g) + size * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), normal))
    assert np.allclose(found, own, rtol=0.0, atol=1e-10)


FIELD = geo.Surface.random(geo.HeightCorrelation(0.1), 16, rms_slope=1.0, rng=2)
IN_SPACE = [
    ker.SurfaceLaw(FIELD),
    ker.SurfaceLaw(FIELD, 0.4),
    0.5 * ker.SurfaceLaw(FIELD) + 0.5 * ker.HemisphereLaw(ker.specular()),
]


@pytest.mark.parametrize("law", IN_SPACE, ids=["random", "fixed", "mixed"])
def test_the_header_draws_the_velocities_of_tables_of_directions(law, header):
    (folder, run), table = header, law.table(4, 5, 6, n_turn=3, tolerance=0.1)
    table.save(folder / "law.csv", overwrite=True)
    v, _ = velocities(300)
    draws = np.random.default_rng(5).random((2, 300))
    found = run("velocities", given=lines_of(v, np.zeros(300), *draws)).reshape(-1, 3)
    assert np.allclose(found, table.sample(v, np.random.default_rng(5)), rtol=0.0, atol=1e-10)
    # turned with the surface by phi
    c, s = np.cos(0.7), np.sin(0.7)
    turned = run("velocities", given=lines_of(v @ [[c, s, 0], [-s, c, 0], [0, 0, 1]], np.full(300, 0.7), *draws))
    assert np.allclose(turned.reshape(-1, 3), found @ [[c, s, 0], [-s, c, 0], [0, 0, 1]], rtol=0.0, atol=1e-10)


def cut(text, line, to=None):
    """The text without a line, or with another in its place."""
    lines = text.splitlines(keepends=True)
    lines[line] = "" if to is None else f"{to}\n"
    return "".join(lines)


@pytest.mark.parametrize(
    ("change", "given", "words"),
    [
        (lambda text: None, "", "expected a file that can be read, got none"),
        (lambda text: cut(text, 0), "", "expected a first line that begins with '# asperity table 1:' or"),
        (lambda text: cut(text, -1), "", "expected 0.523599 as number 1 in row 2 of numbers, of 4 with equal steps"),
        (lambda text: text[:-5], "", "expected a whole file, got one that ends within line 12"),
        (lambda text: cut(text, 9, "0.6,1.0,x"), "", "expected 6 numbers in line 10, got 2: 0.6 1.0 x"),
        (lambda text: cut(text, 9, "0.6,1,1,1,1,1x"), "", "expected 6 numbers in line 10, got 6: 0.6 1 1 1 1 1x"),
        (lambda text: cut(text, 9, ""), "", "expected 6 numbers in line 10, got 0: "),
        (lambda text: "".join(text.splitlines(keepends=True)[:8]), "", "expected 3 rows of 3 numbers, got 1 rows"),
        (lambda text: text, "3.2 0.5", r"expected an incoming angle in (0, pi), got 3.2"),
        (lambda text: text, "1.0 1.5", "expected a random number in [0, 1), got 1.5"),
        (lambda text: text, "nan 0.5", "expected an incoming angle in (0, pi), got nan"),
    ],
)  # fmt: skip
def test_the_header_says_what_it_expected_and_what_came(change, given, words, header):
    folder, run = header
    path = ker.CircularArcLaw(1.2).table(4, 5).save(folder / "law.csv", overwrite=True)
    text = change(path.read_text())
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(subprocess.CalledProcessError) as refused:
        run("angles", given=given)
    assert f"{path}: {words}" in refused.value.stderr


def test_the_header_refuses_tables_of_directions_that_are_cut_and_calls_of_the_other_kind(header):
    folder, run = header
    path = IN_SPACE[1].table(3, 3, 3, n_turn=2, tolerance=0.3).save(folder / "law.csv", overwrite=True)
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    for change, kind, given, words in (
        (text, "angles", "1.0 0.5", "expected a law in the plane, got one of directions in space"),
        (text, "velocities", "1 0 0 0 0.5 0.5", "expected a velocity with a negative third component, got 0"),
        (text, "velocities", "1 0 -1 0 0.5 nan", "expected a random number in [0, 1), got nan"),
        ("".join(lines[:-4]), "velocities", "", "expected 0.25 as number 1 in row 2 of numbers, of 9 with equal steps"),
        ("".join(lines[:-8]), "velocities", "", "expected rows for at least two incoming angles, got 4 rows"),
        ("".join(lines[:-1]), "velocities", "", "expected 0.25 as number 1 in row 2 of numbers, of 12"),
        (
            text.replace("3.14159", "3.0", 1),
            "velocities",
            "",
            "expected 3.14159 as number 2 in row 4 of numbers, of 13",
        ),
    ):
        path.write_text(change)
        with pytest.raises(subprocess.CalledProcessError) as refused:
            run(kind, given=given)
        assert words in refused.value.stderr
