"""Pieces of a user's own class: what the classes of the library know of each other is by registered kinds alone."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.errors import InputError
from asperity.geometry.curves.curve import Curve
from disk_shapes import DISK, PARABOLAS

BOWL = geo.Bezier([(0, 0), (0.5, -1), (1, 0)])


class Bowl(geo.Bezier):
    """A Bezier piece of a class without a kind of its own."""


def test_a_class_without_a_kind_of_its_own_changes_no_wall_files(tmp_path):
    wall = geo.Wall([Bowl(BOWL.control_points)])
    wall.save(tmp_path / "bowl.toml")
    (piece,) = geo.load_wall(tmp_path / "bowl.toml").pieces
    assert type(piece) is geo.Bezier and piece == BOWL


def test_a_ray_meets_a_piece_of_a_derived_class_as_one_of_its_base():
    x, theta = np.linspace(0.1, 0.9, 9), np.linspace(0.5, 2.5, 9)
    own, base = (geo.trace(geo.Wall([piece]), x, theta) for piece in (Bowl(BOWL.control_points), BOWL))
    np.testing.assert_array_equal(own.theta, base.theta)


def test_the_tracer_refuses_a_piece_without_a_table(monkeypatch):
    monkeypatch.setattr(Curve, "traced", lambda: (geo.Arc,))
    with pytest.raises(InputError, match="write it as Bezier curves"):
        geo.Wall([BOWL]).plan()


def test_disks_refuse_pieces_that_they_do_not_meet(monkeypatch):
    monkeypatch.setattr(geo.Bezier, "meets_disks", False)
    with pytest.raises(InputError, match="got a Bezier; write it as Bezier curves"):
        geo.collide(DISK, PARABOLAS, 1e-3, [[0.0, 1.0]], [[0.0, -1.0, 0.0]])


@pytest.mark.parametrize("kind", ['["arc"]', '"Arc"', '"curve"', '""', "3"])
def test_a_file_names_no_class_but_the_registered_kinds(kind, tmp_path):
    (tmp_path / "wall.toml").write_text(f"period = 1\n[[pieces]]\nkind = {kind}\n")
    *names, last = map(repr, sorted(Curve.kinds))
    with pytest.raises(InputError, match=f"'kind': expected {', '.join(names)} or {last}, got"):
        geo.load_wall(tmp_path / "wall.toml")
