"""Long computations whose checkpoint cannot be written, or that another process has open."""

from __future__ import annotations

import sqlite3

import numpy as np
import pytest

from asperity import FileExistsRefusal, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import checkpoints
from asperity.core.long_runs import all_parts
from asperity.kernels.billiards import billiard
from asperity.kernels.sampling import chunks, streams
from asperity.spectral.consequences import channel

DISK = geo.Disk(1.0, 0.5)
WALL = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))


def exits(path):
    return spec.exit_times(ker.maxwell(0.5), [2.0, 4.0, 8.0], 200, 7, checkpoint=path).times


def played(path):
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(0.9), DISK)
    velocity = DISK.from_angles(np.linspace(0.5, 2.5, 200), np.full(200, 1.0))
    return ker.play(geo.Container.strip(), law, np.zeros((200, 2)), velocity, 5, 7, checkpoint=path).position


def studied(path):
    disk, wall = geo.Disk(1.0, 1.0), geo.triangular_teeth(1.2)
    found = ker.limit_study(disk, wall, [1e-3, 1e-4, 1e-5], 7, samples=(2, 3, 40), repetitions=4, checkpoint=path)
    return np.concatenate([values.ravel() for values in found.errors.values()])


def streamed(path):
    rng = np.random.default_rng(0)
    pairs = ker.SINE.sample(2000, rng), ker.SINE.sample(2000, rng)
    return ker.estimate_stream(pairs, ker.Bins(40), checkpoint=path).symmetric


def counted(method):
    def run(path):
        return ker.discretise(WALL, ker.Bins(40), method, samples=2**12, rng=3, checkpoint=path).symmetric

    return run


def averaged(path):
    return spec.mean_law(lambda rng: ker.maxwell(0.5), 8, ker.Bins(40), checkpoint=path).symmetric


RUNS = {
    "exit_times": exits, "play": played, "limit_study": studied, "estimate_stream": streamed, "mean_law": averaged,
    "monte-carlo": counted("monte-carlo"), "qmc": counted("qmc"),
}  # fmt: skip
# Those that store all sums in one piece, in place of the earlier ones.
IN_ONE_PIECE = {"estimate_stream", "monte-carlo", "qmc"}
# Pages of 4 kB that are left on the disk: for some parts, or too few for the sums.
LEFT = {"exit_times": 1, "play": 4, "limit_study": 1, "mean_law": 12}


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    monkeypatch.setattr(channel, "TOGETHER", 16)
    monkeypatch.setattr(billiard, "TOGETHER", 16)
    monkeypatch.setattr(streams, "BLOCK", 512)
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    for module in (streams, chunks):
        monkeypatch.setattr(module, "STORED_EVERY", 0.0)
    monkeypatch.setattr(checkpoints, "MOMENT", 0.0)
    monkeypatch.setattr(checkpoints, "PATIENCE", 0.01)


def parts_in(path):
    with sqlite3.connect(path) as file:
        (number,) = file.execute("SELECT COUNT(*) FROM parts").fetchone()
    file.close()
    return number


@pytest.mark.parametrize("name", RUNS)
def test_a_full_disk_stops_with_a_message_and_what_was_written_is_gone_on_with(name, tmp_path, monkeypatch):
    whole, path = RUNS[name](None), tmp_path / "a"
    original = checkpoints.Checkpoint._begin

    def limited(self, *arguments):
        original(self, *arguments)
        (pages,) = self._file.execute("PRAGMA page_count").fetchone()
        # pages beyond these are as good as a full disk for SQLite
        self._file.execute(f"PRAGMA max_page_count = {pages + LEFT.get(name, 1)}")

    monkeypatch.setattr(checkpoints.Checkpoint, "_begin", limited)
    with pytest.raises(InputError, match=r"disk is full.*what was written before is safe. Free space"):
        RUNS[name](path)
    assert (parts_in(path) > 0) == (name not in IN_ONE_PIECE)
    monkeypatch.setattr(checkpoints.Checkpoint, "_begin", original)
    assert np.array_equal(RUNS[name](path), whole)


@pytest.mark.parametrize("name", RUNS)
def test_a_second_process_on_a_checkpoint_is_refused_and_harms_nothing(name, tmp_path):
    path = tmp_path / "a"
    whole = RUNS[name](path)
    before = path.read_bytes()
    other = sqlite3.connect(path, isolation_level=None)
    try:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(FileExistsRefusal, match="in use by another process; wait for it or name another file"):
            RUNS[name](path)
    finally:
        other.close()
    assert path.read_bytes() == before and np.array_equal(RUNS[name](path), whole)


def squares(path):
    return [int(part["square"]) for part in all_parts(lambda k: {"square": k**2}, 3, {}, {"checkpoint": path})]


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE parts SET value = NULL", "UPDATE parts SET value = 'a'", "UPDATE parts SET key = 'x' WHERE key = '1'",
        "UPDATE parts SET digest = 'x'", "INSERT INTO parts SELECT '9', value, digest FROM parts LIMIT 1",
        "DELETE FROM identity", "UPDATE identity SET value = '{'", "UPDATE identity SET value = NULL",
        "UPDATE identity SET value = replace(hex(zeroblob(50000)), '0', '[')", "UPDATE identity SET format = NULL",
        "ALTER TABLE parts DROP COLUMN digest", "ALTER TABLE identity DROP COLUMN value",
    ],
)  # fmt: skip
def test_a_checkpoint_that_was_changed_is_refused(tmp_path, statement):
    squares(tmp_path / "run")
    with sqlite3.connect(tmp_path / "run") as file:
        file.execute(statement)
    file.close()
    with pytest.raises(InputError, match="run"):
        squares(tmp_path / "run")


def test_a_checkpoint_with_any_bit_flipped_gives_the_same_numbers_or_is_refused(tmp_path):
    path = tmp_path / "run"
    squares(path)
    whole, rng, refused = path.read_bytes(), np.random.default_rng(0), 0
    content = np.flatnonzero(np.frombuffer(whole, np.uint8))
    for position in rng.choice(content, 200):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            assert squares(path) == [0, 1, 4]
        except InputError:
            refused += 1
    assert refused > 100


def test_a_checkpoint_that_was_cut_off_is_refused_or_begun_anew(tmp_path):
    path = tmp_path / "run"
    squares(path)
    whole, refused = path.read_bytes(), 0
    ends = range(1, len(whole), 601)
    for end in ends:
        path.write_bytes(whole[:end])
        try:
            assert squares(path) == [0, 1, 4]
        except InputError:
            refused += 1
    assert 0.9 * len(ends) < refused
