"""Checkpoints that were changed, damaged or cut off."""

from __future__ import annotations

import sqlite3

import numpy as np
import pytest

from asperity import InputError
from asperity.core.checkpoints import Checkpoint
from asperity.core.long_runs import all_parts


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
        "CREATE TRIGGER more AFTER INSERT ON parts BEGIN DELETE FROM parts; END",
        "CREATE VIEW seen AS SELECT * FROM parts", "CREATE TABLE more (a)", "CREATE INDEX more ON parts (value)",
        "ALTER TABLE parts ADD COLUMN more", "ALTER TABLE identity RENAME COLUMN value TO other",
        "INSERT INTO identity SELECT * FROM identity",
    ],
)  # fmt: skip
def test_a_checkpoint_that_was_changed_is_refused(tmp_path, statement):
    squares(tmp_path / "run")
    with sqlite3.connect(tmp_path / "run") as file:
        file.execute(statement)
    file.close()
    with pytest.raises(InputError, match="run"):
        squares(tmp_path / "run")
    if statement.startswith(("CREATE", "ALTER TABLE parts ADD", "ALTER TABLE identity RENAME")):
        with pytest.raises(InputError, match="run"):
            Checkpoint(tmp_path / "run", {}, overwrite=True)


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
