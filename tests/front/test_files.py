"""Files that others made or damaged are refused in words, and no failure costs a file that was there."""

from __future__ import annotations

import json
import os
import pickle
import resource
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench import run, standard_set
from asperity.cli import main
from asperity.errors import AccuracyError, FileExistsRefusal, InputError, WallError
from asperity.estimates import Estimate
from asperity.study import study_wall

SAMPLED = ker.discretise(ker.CircularArcLaw(0.1), ker.Bins(200), method="qmc", samples=8192)
EXACT = ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(6))


@contextmanager
def full_disk() -> Iterator[None]:
    """No file grows beyond 100 bytes meanwhile."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# matrices that were tampered with


def tampered(path: Path, **changes: object) -> Path:
    """The file with other members; ``record`` holds changed values of the record."""
    with np.load(path) as archive:
        arrays = dict(archive)
    if "record" in changes:
        record = json.loads(str(arrays["record"])) | changes.pop("record")
        arrays["record"] = np.array(json.dumps(record))
    np.savez_compressed(path, **{**arrays, **changes})
    return path


@pytest.mark.parametrize("where", ["indices", "indptr"])
def test_sparse_indices_out_of_range_are_refused_before_compiled_code_uses_them(tmp_path, where):
    path = SAMPLED.save(tmp_path / "kernel.npz")
    with np.load(path) as archive:
        name = next(name for name in archive.files if name.endswith(where))
        indices = archive[name].copy()
    for bad in (10**6, -(10**6)):
        indices[-1] = bad
        with pytest.raises(InputError, match="is not a kernel matrix"):
            ker.load_matrix(tampered(path, **{name: indices}))
    with pytest.raises(InputError, match="is not a kernel matrix"):
        ker.load_matrix(tampered(path, **{name: indices.astype(float)}))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"symmetric": 3.0 * EXACT.symmetric}, "norm"),
        ({"symmetric": 0.5 * EXACT.symmetric}, "sum to 1"),
        ({"symmetric": EXACT.symmetric + [[0, 1, -1, 0, 0, 0]] * 6}, "symmetric"),
        ({"symmetric": 2.0 * np.eye(6) - EXACT.symmetric}, "negative"),
        ({"symmetric": np.full((6, 6), np.nan)}, "finite"),
        ({"symmetric": np.eye(5)}, "shape"),
        ({"symmetric": EXACT.symmetric.astype("U9")}, "expected f8 of shape"),
        ({"record": {"error": [-1.0, -1.0, "bound", "by hand"]}}, "error: expected"),
        ({"record": {"error": [0.0, 0.0, "hope", "by hand"]}}, "kind: expected"),
        ({"record": {"frame": "picture"}}, "frame: expected"),
        ({"record": {"samples": -5}}, "samples: expected"),
        ({"record": {"norm_bound": -1.0}}, "norm_bound: expected"),
        ({"record": {"reversible": "yes"}}, "reversible: expected"),
        ({"record": {"version": 7}}, "version 7"),
        ({"record": {"basis": {"kind": "Legendre", "n": 10**12, "weight": "sin"}}}, "shape"),
    ],
)
def test_a_matrix_that_contradicts_itself_is_refused(tmp_path, changes, words):
    path = tampered(EXACT.save(tmp_path / "kernel.npz"), **changes)
    with pytest.raises(InputError, match=rf"(?s)kernel\.npz.*({words})"):
        ker.load_matrix(path)


def test_multiples_and_differences_are_loaded_although_they_are_no_kernels(tmp_path):
    for number, matrix in enumerate((3.0 * EXACT, EXACT - EXACT @ EXACT, -EXACT, EXACT.tensor(EXACT), SAMPLED**2)):
        again = ker.load_matrix(matrix.save(tmp_path / f"{number}.npz"))
        assert np.array_equal(again.symmetric, matrix.symmetric)


def test_members_that_no_matrix_has_are_never_inflated(tmp_path, monkeypatch):
    path = EXACT.save(tmp_path / "kernel.npz")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("bomb.npy", b"no array")
    opened = []
    inflate = zipfile.ZipFile.open

    def counted(self, info, *rest, **options):
        opened.append(getattr(info, "filename", info))
        return inflate(self, info, *rest, **options)

    monkeypatch.setattr(zipfile.ZipFile, "open", counted)
    assert np.array_equal(ker.load_matrix(path).symmetric, EXACT.symmetric)
    assert opened and "bomb.npy" not in opened


def test_an_array_whose_header_promises_more_than_its_data_is_refused(tmp_path):
    path = EXACT.save(tmp_path / "kernel.npz")
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    huge = BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"shape": (10**7, 10**7), "fortran_order": False, "descr": "<f8"})
    members["symmetric.npy"] = huge.getvalue() + b"\0" * 64
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    with pytest.raises(InputError, match="does not have the size"):
        ker.load_matrix(path)


def test_a_file_with_any_bit_flipped_is_read_or_refused(tmp_path):
    whole = EXACT.save(tmp_path / "kernel.npz").read_bytes()
    damaged = tmp_path / "damaged.npz"
    read = 0
    for position in range(0, len(whole), 3):
        data = bytearray(whole)
        data[position] ^= 1 << (position % 8)
        damaged.write_bytes(data)
        try:
            matrix = ker.load_matrix(damaged)
        except InputError:
            continue
        # a bit of no meaning, such as one of a date
        read += 1
        assert np.array_equal(matrix.symmetric, EXACT.symmetric)
    assert read < len(whole) / 6


# walls


def wall_file(folder: Path, text: str) -> Path:
    file = folder / "wall.toml"
    file.write_text(text)
    return file


def test_a_vertex_a_thousand_periods_away_is_tested_or_refused_at_once(tmp_path):
    crossing = "period = 1.0\nvertices = [[0, 0], [0.5, -1], [{0}, -2], [0.6, -3], [0.7, -0.1], [1, 0]]"
    with pytest.raises(WallError, match="piece 1 and piece 3 cross"):
        geo.load_wall(wall_file(tmp_path, crossing.format(1e3)))
    for far in (1e5, 1e99):
        with pytest.raises(WallError, match="periods beyond the cell"):
            geo.load_wall(wall_file(tmp_path, crossing.format(far)))
    assert geo.load_wall(wall_file(tmp_path, "period = 1\nvertices = [[0, 0], [300, -0.4], [1, 0]]")).closes


def test_crossings_with_far_periods_only_are_found():
    # under a roof five periods long a pillar from the floor, which the roof of the fifth cell behind it meets
    vertices = [(0, 0), (0.1, -1), (5.5, -1.2), (0.2, -2), (0.3, -2), (0.35, -1.19), (0.4, -2), (0.9, -2), (1, 0)]
    with pytest.raises(WallError, match="cross"):
        geo.Wall.from_vertices(vertices)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("name", ["wall.toml", "profile.txt", "kernel.npz"])
def test_a_pipe_is_refused_and_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    read = {".toml": geo.load_wall, ".txt": geo.read_profile, ".npz": ker.load_matrix}[Path(name).suffix]
    with pytest.raises(InputError, match="expected a file"):
        read(tmp_path / name)


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "loop", "no UTF-8", "deep", "long name"])
def test_a_report_of_work_is_continued_from_a_text_only(tmp_path, kind):
    path = tmp_path / "report.json"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "loop":
        path.symlink_to(path)
    elif kind in ("no UTF-8", "deep"):
        path.write_bytes(b"\xff" if kind == "no UTF-8" else b"[" * 100000)
    path = {"device": Path("/dev/zero"), "long name": tmp_path / ("n" * 300)}.get(kind, path)
    problem = spec.WorkProblem("a", (spec.ReferenceValue(0.0, 0.0, "by hand"),))
    with pytest.raises(InputError):
        spec.work_precision(problem, [spec.WorkMethod("b", float)], [1.0], repeats=1, path=path)


@pytest.mark.parametrize("read", [geo.load_wall, geo.read_profile, ker.load_matrix])
def test_a_name_that_is_too_long_is_refused(tmp_path, read):
    with pytest.raises(InputError, match="nnn"):
        read(tmp_path / ("n" * 300))


@pytest.mark.parametrize("key", ["a." * 20000 + "x = 1", "[" + "a . " * 20000 + "x]"])
def test_a_key_of_many_parts_is_refused_at_once(tmp_path, key):
    file = wall_file(tmp_path, key)
    begun = time.process_time()
    with pytest.raises(InputError, match="more than 64 parts"):
        geo.load_wall(file)
    assert time.process_time() - begun < 1.0


@pytest.mark.parametrize("read", [spec.SweepTable.of_json, spec.WorkReport.of_json])
def test_a_deeply_nested_table_is_refused(read):
    with pytest.raises(InputError, match="JSON"):
        read("[" * 100000)


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "{b=" * 5000, "period = " + "9" * 5000])
def test_toml_beyond_the_parsers_limits_is_refused(tmp_path, text):
    with pytest.raises(InputError, match=r"wall\.toml: "):
        geo.load_wall(wall_file(tmp_path, text))


def test_a_whole_number_beyond_double_precision_is_refused(tmp_path):
    with pytest.raises(InputError, match="'period': expected a number below 1e308"):
        geo.load_wall(wall_file(tmp_path, f"period = 1{'0' * 400}\nvertices = [[0, 0], [1, 0]]"))


# nothing is lost


# numpy 2.0 leaves the archive open whose writing failed, and Python then warns of it; later versions close it
@pytest.mark.filterwarnings("ignore:.*ZipFile.__del__:pytest.PytestUnraisableExceptionWarning")
def test_a_full_disk_leaves_an_old_wall_and_an_old_matrix_as_they_are(tmp_path):
    geo.flat().save(tmp_path / "wall.toml")
    EXACT.save(tmp_path / "kernel.npz")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with full_disk():
        with pytest.raises(InputError, match="cannot write"):
            geo.koch(3).save(tmp_path / "wall.toml", overwrite=True)
        with pytest.raises(InputError, match="cannot write"):
            SAMPLED.save(tmp_path / "kernel.npz", overwrite=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_full_disk_leaves_an_old_study_as_it_is(tmp_path):
    study = study_wall(geo.flat(), bins=4)
    study.save(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with full_disk(), pytest.raises(InputError, match="cannot write"):
        replace(study, name="another").save(tmp_path, overwrite=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_replaced_file_keeps_its_permissions_and_links_to_it_hold(tmp_path):
    target = tmp_path / "wall.toml"
    geo.flat().save(target)
    target.chmod(0o640)
    (tmp_path / "link.toml").symlink_to(target)
    geo.koch(1).save(tmp_path / "link.toml", overwrite=True)
    assert (tmp_path / "link.toml").is_symlink() and target.stat().st_mode & 0o777 == 0o640
    assert geo.load_wall(target) == geo.koch(1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_written_to_and_not_replaced(tmp_path):
    # stands for devices such as /dev/null, which a test must not risk
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        EXACT.save(pipe, overwrite=True)
        assert pipe.is_fifo() and os.read(reader, 2) == b"PK"
    finally:
        os.close(reader)


# asperity bench


def bench(*arguments: object) -> object:
    return CliRunner().invoke(main, ["bench", *map(str, arguments)])


@pytest.fixture
def measured(monkeypatch) -> None:
    """No problem is measured: a run has no reports."""
    monkeypatch.setattr(standard_set, "run_problems", lambda *_: iter(()))


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize("name", ["summary.md", "tables.md", "bench.json", "koch.png"])
def test_bench_replaces_no_file_that_it_did_not_write(tmp_path, name):
    (tmp_path / name).write_text("precious")
    refused = bench("koch/law", "--out", tmp_path)
    assert refused.exit_code == 1 and name in refused.output and "--force" in refused.output
    assert (tmp_path / name).read_text() == "precious" and names_in(tmp_path) == [name]


@pytest.mark.usefixtures("measured")
def test_bench_goes_on_where_it_was_and_keeps_a_larger_run(tmp_path):
    assert bench("koch/law", "--out", tmp_path).exit_code == 0
    assert bench("koch/law", "--out", tmp_path).exit_code == 0
    report = spec.WorkReport.of(
        spec.WorkProblem("koch/moment", spec.ReferenceValue(0.0, 0.0, "by hand")),
        [spec.WorkMethod("a", float)], spec.Machine.here(),
    )  # fmt: skip
    (tmp_path / "bench.json").write_text(run.BenchRun((report,)).to_json())
    assert bench("koch/law", "--out", tmp_path).exit_code == 1
    assert bench("koch", "--out", tmp_path).exit_code == 0


@pytest.mark.usefixtures("measured")
def test_bench_with_force_removes_the_rows_of_its_problems_and_no_other_file(tmp_path):
    for name in ("koch-law.json", "koch-moment.json", "mine.json", "summary.md"):
        (tmp_path / name).write_text("{}")
    assert bench("koch/law", "--out", tmp_path, "--force").exit_code == 0
    assert names_in(tmp_path) == ["bench.json", "koch-moment.json", "mine.json", "summary.md", "tables.md"]


# values


def raise_accuracy_error(_: int) -> None:
    raise AccuracyError("out of reach", 0.25)


def test_an_accuracy_error_comes_out_of_a_process_pool():
    again = pickle.loads(pickle.dumps(AccuracyError("out of reach", 0.25)))
    assert (str(again), again.defect) == ("out of reach", 0.25)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool, pytest.raises(AccuracyError, match="out of reach"):
        list(pool.map(raise_accuracy_error, [0]))


def test_every_error_survives_pickling():
    for error in (WallError("a"), InputError("b"), FileExistsRefusal("c exists")):
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error) and str(again) == str(error)


def test_the_array_of_a_matrix_is_one_read_only_array():
    assert EXACT.array is EXACT.array
    with pytest.raises(ValueError, match="read-only"):
        EXACT.array[0, 0] = 1.0
    assert np.asarray(EXACT) is EXACT.array
    assert np.array(EXACT, dtype=np.float32).dtype == np.float32


def test_a_matrix_from_a_pickle_is_read_only_too():
    again = pickle.loads(pickle.dumps(EXACT))
    assert np.array_equal(again.array, EXACT.array)
    assert not again.symmetric.flags.writeable and not again.array.flags.writeable


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ((1.0, -1.0, "bound", ""), "error"),
        ((1.0, np.nan, "bound", ""), "error"),
        ((1.0, 0.1, "guess", ""), "kind"),
        (("many", 0.1, "bound", ""), "value"),
        ((10**400, 0.1, "bound", ""), "value"),
        ((1.0, 0.1, "bound", 3), "method"),
    ],
)
def test_an_estimate_refuses_what_is_no_error(given, name):
    with pytest.raises(InputError, match=f"^{name}: expected"):
        Estimate(*given)


# what does not fit


@pytest.mark.parametrize("basis", [ker.Bins(10**6), ker.Legendre(10**6)], ids=repr)
def test_a_matrix_that_no_memory_holds_is_refused_with_its_size(basis):
    for make in (
        lambda: ker.discretise(ker.lambertian(), basis),
        lambda: ker.estimate([1.0] * 100, [1.0] * 100, basis),
    ):
        with pytest.raises(InputError, match=r"1000000\) takes 8e\+03 GB of memory"):
            make()


def test_a_basis_that_no_memory_holds_is_refused():
    for make in (lambda: ker.Bins(10**15), lambda: ker.Panels([0.0, np.pi], 10**9)):
        with pytest.raises(InputError, match="GB of memory"):
            make()


# random numbers

SAMPLERS = {
    "Law.sample": lambda rng: ker.lambertian().sample(np.full(4, 1.0), rng=rng),
    "CollisionLaw.sample": lambda rng: ker.CollisionLaw(ker.lambertian(), geo.Disk()).sample(
        [[0.1, -1.0, 0.2]], rng=rng
    ),
    "discretise": lambda rng: ker.discretise(ker.lambertian(), ker.Bins(2), "monte-carlo", samples=64, rng=rng).array,
    "exit_times": lambda rng: spec.exit_times(ker.lambertian(), [1.0, 2.0, 4.0], 8, rng).times,
}


@pytest.mark.parametrize("name", SAMPLERS)
def test_a_seed_and_its_generator_give_the_same_numbers(name):
    sample = SAMPLERS[name]
    assert np.array_equal(sample(5), sample(np.random.default_rng(5)))
    assert not np.array_equal(sample(5), sample(6))
    assert np.array_equal(sample(None), sample(None)) == (name == "discretise")
    for wrong in (-1, 0.5, "seed", True, np.random.RandomState(0)):
        with pytest.raises(InputError, match="rng: expected None, a whole number"):
            sample(wrong)
