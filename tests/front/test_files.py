"""Files that others made or damaged are refused in words, and no failure costs a file that was there."""

import json
import os
import pickle
import resource
import time
import tracemalloc
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import FrozenInstanceError, replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench import standard_set
from asperity.errors import AccuracyError, FileExistsRefusal, InputError, WallError
from asperity.study import study_wall
from commands import run

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


@contextmanager
def little_memory() -> Iterator[None]:
    """At most 16 MB are taken meanwhile."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


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
        *(({"record": record}, "is not a kernel matrix") for record in (
            {"error": [float("nan"), 0.0, "bound", ""]}, {"error": [0.5, 0.0, "bound", ""]}, {"law": 3}, {"law": None},
            {"law": ["a"]}, {"method": {}}, {"samples": 10**30}, {"unresolved": True}, {"unresolved": "0.0"},
            {"symmetrised": 1}, {"requested_tolerance": float("nan")}, {"norm_bound": float("inf")},
            {"metadata": [["a", 1]]}, {"raw_defect": [float("nan"), "a", None]}, {"raw_defect": [0.1, 3, None]},
            {"replicates": ["fog"]}, {"replicates": 1},
        )),
    ],
)  # fmt: skip
def test_a_matrix_that_contradicts_itself_is_refused(tmp_path, changes, words):
    path = tampered(EXACT.save(tmp_path / "kernel.npz"), **changes)
    with pytest.raises(InputError, match=rf"(?s)kernel\.npz.*({words})"):
        ker.load_matrix(path)


def test_multiples_and_differences_are_loaded_although_they_are_no_kernels(tmp_path):
    for number, matrix in enumerate((3.0 * EXACT, EXACT - EXACT @ EXACT, -EXACT, EXACT.tensor(EXACT), SAMPLED**2)):
        again = ker.load_matrix(matrix.save(tmp_path / f"{number}.npz"))
        assert np.array_equal(again.symmetric, matrix.symmetric)


def with_member(path: Path, name: str, data: bytes, method: int = zipfile.ZIP_STORED) -> None:
    """Put a member into the archive, in place of the one of this name."""
    with zipfile.ZipFile(path) as archive:
        members = {one: archive.read(one) for one in archive.namelist()}
    with zipfile.ZipFile(path, "w", method) as archive:
        for one, content in {**members, f"{name}.npy": data}.items():
            archive.writestr(one, content)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method"),
    [(name, zipfile.ZIP_DEFLATED) for name in ("symmetric", "counts", "basis", "record", "none")]
    + [("record", zipfile.ZIP_LZMA)],
)
def test_no_member_is_inflated_before_its_header_is_checked(tmp_path, name, method):
    path = ker.discretise(ker.lambertian(), ker.Bins([0.0, 1.0, np.pi])).save(tmp_path / "kernel.npz")
    bomb = BytesIO()
    np.save(bomb, np.zeros((1800, 1800)) if name != "record" else np.array("a" * 2 * 10**7))
    with_member(path, name, bomb.getvalue(), method)
    del bomb
    with little_memory():
        if name == "none" and method == zipfile.ZIP_DEFLATED:
            assert ker.load_matrix(path).size == 2
        else:
            with pytest.raises(InputError, match="is not a kernel matrix"):
                ker.load_matrix(path)


def test_an_array_whose_header_promises_more_than_its_data_is_refused(tmp_path):
    path = EXACT.save(tmp_path / "kernel.npz")
    huge = BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"shape": (10**7, 10**7), "fortran_order": False, "descr": "<f8"})
    with_member(path, "symmetric", huge.getvalue() + b"\0" * 64)
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


@pytest.mark.parametrize("control", [1e15, 1e30, 1e90])
def test_a_bezier_piece_with_a_far_control_point_takes_little_memory(control):
    with little_memory(), pytest.raises(WallError, match="rises to"):
        geo.Wall([geo.Bezier([(0, 0), (0.5, control), (0.6, -1), (1, 0)])])


@pytest.mark.usefixtures("uncollected")
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


# nothing is lost


def test_a_full_disk_leaves_an_old_wall_matrix_and_study_as_they_are(tmp_path):
    geo.flat().save(tmp_path / "wall.toml")
    EXACT.save(tmp_path / "kernel.npz")
    study = study_wall(geo.flat(), bins=4)
    study.save(tmp_path / "study")
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    before = {path: path.read_bytes() for path in files}
    with full_disk():
        for save in (
            lambda: geo.koch(3).save(tmp_path / "wall.toml", overwrite=True),
            lambda: SAMPLED.save(tmp_path / "kernel.npz", overwrite=True),
            lambda: replace(study, name="another").save(tmp_path / "study", overwrite=True),
        ):
            with pytest.raises(InputError, match="cannot write"):
                save()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


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


@pytest.fixture
def measured(monkeypatch) -> None:
    """No problem is measured: a run has no reports."""
    monkeypatch.setattr(standard_set, "run_problems", lambda *_: iter(()))


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize("name", ["summary.md", "tables.md", "bench.json", "koch.png"])
def test_bench_replaces_no_file_that_it_did_not_write(tmp_path, name):
    (tmp_path / name).write_text("precious")
    refused = run("bench", "koch/law", "--out", tmp_path)
    assert refused.exit_code == 1 and name in refused.output and "--force" in refused.output
    assert (tmp_path / name).read_text() == "precious" and names_in(tmp_path) == [name]


@pytest.mark.usefixtures("measured")
def test_bench_goes_on_where_it_was_and_keeps_a_larger_run(tmp_path):
    assert run("bench", "koch/law", "--out", tmp_path).exit_code == 0
    assert run("bench", "koch/law", "--out", tmp_path).exit_code == 0
    (tmp_path / "bench.json").write_text('{"reports": [{"problem": "koch/moment"}]}')
    assert run("bench", "koch/law", "--out", tmp_path).exit_code == 1
    assert run("bench", "koch", "--out", tmp_path).exit_code == 0


@pytest.mark.usefixtures("measured")
def test_bench_with_force_removes_the_rows_of_its_problems_and_no_other_file(tmp_path):
    for name in ("koch-law.json", "koch-moment.json", "mine.json", "summary.md"):
        (tmp_path / name).write_text("{}")
    assert run("bench", "koch/law", "--out", tmp_path, "--force").exit_code == 0
    assert names_in(tmp_path) == ["bench.json", "koch-moment.json", "mine.json", "summary.md", "tables.md"]


# values


def test_every_error_survives_pickling():
    for error in (WallError("a"), InputError("b"), FileExistsRefusal("c exists"), AccuracyError("out of reach", 0.25)):
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error) and str(again) == str(error)
    assert again.defect == 0.25


def test_the_array_of_a_matrix_is_one_read_only_array_also_from_a_pickle():
    assert EXACT.array is EXACT.array
    for array in (EXACT.array, EXACT.symmetric):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        EXACT.law = "other"
    assert np.asarray(EXACT) is EXACT.array
    assert np.array(EXACT, dtype=np.float32).dtype == np.float32
    again = pickle.loads(pickle.dumps(EXACT))
    assert np.array_equal(again.array, EXACT.array)
    assert not again.symmetric.flags.writeable and not again.array.flags.writeable


def test_sampled_matrices_are_the_same_without_a_seed():
    for method in ("monte-carlo", "qmc"):
        one, two = (ker.discretise(ker.CircularArcLaw(0.5), ker.Bins(4), method, samples=64) for _ in range(2))
        assert np.array_equal(one.array, two.array)
