"""Files: walls as TOML, and what the command line calls WALL."""

import math

import pytest

from asperity import geometry as geo
from asperity.errors import InputError

pi = math.pi


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "missing", tmp_path / "file"):
        with pytest.raises(InputError, match=r"wall\.toml: cannot write there .* folder that is writable"):
            geo.flat().save(folder / "wall.toml")


def test_a_wall_may_be_written_by_hand(tmp_path):
    file = tmp_path / "hand.toml"
    text = "# a groove and a round notch\nperiod = 2\n[[pieces]]\nkind = 'segment'\nstart = [0, 0]\nend = [1, 0]\n"
    notch = "[[pieces]]\nkind = 'arc'\ncenter = [1.5, 0.0]\nsemi_axes = 0.5\n"
    file.write_text(text + notch + "angles = [3.141592653589793, 6.283185307179586]\n")
    wall = geo.load_wall(file)
    assert wall.vertices.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert wall.arc_length == pytest.approx(1 + pi / 2, rel=1e-15)


def test_walls_are_found_by_name_and_parameters():
    assert geo.wall_from_text("focusing-arcs:half_angle=0.9") == geo.focusing_arcs(0.9)
    assert geo.wall_from_text("Focusing_Arcs: half-angle = 0.9") == geo.focusing_arcs(0.9)
    assert geo.wall_from_text("mushrooms:stem_to_cap=.3,stem_aspect=1,generations=2") == geo.mushrooms(0.3, 1.0, 2)
    elliptical = geo.wall_from_text("elliptical-arcs:half_angle=0.5,inertia_ratio=0.35")
    assert elliptical == geo.elliptical_arcs(0.5, geo.Disk(2.0, 0.35))


def test_walls_are_found_by_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    geo.focusing_arcs(0.5).save("arc.toml")
    assert geo.wall_from_text("arc.toml") == geo.focusing_arcs(0.5)
    assert geo.wall_from_text(str(tmp_path / "arc.toml")) == geo.focusing_arcs(0.5)
    (tmp_path / "scan.txt").write_text("0 1\n1 2\n3 0\n")
    assert geo.wall_from_text("scan.txt") == geo.Wall.from_profile([0, 1, 3], [1, 2, 0])
    assert geo.wall_from_text("scan.txt:seam=step") == geo.Wall.from_profile([0, 1, 3], [1, 2, 0], "step")
