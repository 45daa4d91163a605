"""Files: walls as TOML, and what the command line calls WALL."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity.errors import FileExistsRefusal, InputError, WallError

pi = math.pi
FLOOR = [geo.Segment((0, -1), (1, -1))]

WALLS = {name: entry.build() for name, entry in geo.WALLS.items()}
WALLS["flat arc"] = geo.focusing_arcs(1e-8)
WALLS["mixed"] = geo.Wall(
    [geo.Segment((0, 0), (0.1, -0.7)), geo.Bezier([(0.1, -0.7), (0.3, -2 / 3), (0.4, -1), (0.5, -0.1)]),
     geo.Arc((0.75, -0.1), 0.25, pi, 2 * pi), geo.Segment((1, -0.1), (1, 0))]
)  # fmt: skip
WALLS["islands"] = geo.Wall(
    FLOOR,
    islands=[
        [geo.Arc((0.3, -0.4), (0.1, 0.2), 0, 2 * pi)],
        [geo.Segment((0.6, -0.5), (0.8, -0.5)), geo.Segment((0.8, -0.5), (0.6, -0.5))],
    ],
)
WALLS["foreshortened"] = geo.dispersing_arcs(1 / 3).foreshorten(geo.Disk(1.0, 0.3)).scaled(1e-6)


@pytest.mark.parametrize("name", WALLS)
def test_a_saved_wall_is_read_back_to_the_bit(name, tmp_path):
    wall = WALLS[name]
    wall.save(tmp_path / "wall.toml")
    again = geo.load_wall(tmp_path / "wall.toml")
    assert again == wall
    assert repr(again.vertices.tolist()) == repr(wall.vertices.tolist())
    assert again.arc_length == wall.arc_length and again.hollows == wall.hollows
    again.save(str(tmp_path / "again.toml"))
    assert (tmp_path / "again.toml").read_bytes() == (tmp_path / "wall.toml").read_bytes()


@given(st.lists(st.tuples(st.floats(1e-3, 1.0), st.floats(1e-12, 2.0)), min_size=1, max_size=6))
def test_every_float_survives_the_file(tmp_path_factory, steps):
    x = np.cumsum([0.0, *(s for s, _ in steps), 0.1])
    wall = geo.Wall.from_vertices(np.column_stack([x, [0.0, *(-d for _, d in steps), 0.0]]))
    file = tmp_path_factory.mktemp("walls") / "wall.toml"
    wall.save(file)
    assert geo.load_wall(file) == wall


def test_an_existing_file_is_kept_unless_overwriting_is_asked_for(tmp_path):
    file = tmp_path / "wall.toml"
    file.write_text("precious")
    with pytest.raises(FileExistsRefusal, match="overwrite=True"):
        geo.flat().save(file)
    assert file.read_text() == "precious"
    geo.flat().save(file, overwrite=True)
    assert geo.load_wall(file) == geo.flat()


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "missing", tmp_path / "file"):
        with pytest.raises(InputError, match=r"wall\.toml: cannot write there .* folder that is writable"):
            geo.flat().save(folder / "wall.toml")


def test_a_wall_may_be_written_by_hand(tmp_path):
    file = tmp_path / "hand.toml"
    file.write_text(
        """
        # a groove and a round notch
        period = 2
        [[pieces]]
        kind = "segment"
        start = [0, 0]
        end = [1, 0]
        [[pieces]]
        kind = "arc"
        center = [1.5, 0.0]
        semi_axes = 0.5
        angles = [3.141592653589793, 6.283185307179586]
        """
    )
    wall = geo.load_wall(file)
    assert wall.vertices.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert wall.arc_length == pytest.approx(1 + pi / 2, rel=1e-15)


SEGMENT = '[[pieces]]\nkind = "segment"\nstart = [0, 0]\nend = [1, 0]\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("period = = 1", "not a TOML file .*line 1"),
        ("vertices = [[0, 0], [1, 0]]", "missing key 'period'"),
        ("period = 1", "'vertices' and 'pieces'"),
        ("period = 1\nvertices = [[0, 0], [1, 0]]\n" + SEGMENT, "exactly one"),
        ("period = 1\nvertices = [[0, 0], [1, 0]]\ndepth = 2", "unknown key 'depth'"),
        ('period = "1"\nvertices = [[0, 0], [1, 0]]', "key 'period': expected a number"),
        ("period = true\nvertices = [[0, 0], [1, 0]]", "key 'period'"),
        ("period = 1\nvertices = [[0, 0], [1]]", r"key 'vertices\[1\]': expected two numbers"),
        ("period = 1\nvertices = 3", "key 'vertices': expected a list of points"),
        ("period = 1\nvertices = [[0, 0], [0.5, nan], [1, 0]]", "finite"),
        ("period = 1\n" + SEGMENT.replace("segment", "spline"), r"pieces\[0\]: key 'kind': .*'spline'"),
        ("period = 1\n" + SEGMENT.replace('kind = "segment"', ""), r"pieces\[0\]: missing key 'kind'"),
        ("period = 1\n" + SEGMENT.replace("end = [1, 0]", ""), r"pieces\[0\]: missing key 'end'"),
        ("period = 1\n" + SEGMENT + "radius = 1", r"pieces\[0\]: unknown key 'radius'"),
        ("period = 1\npieces = 3", r"array of tables"),
        ('period = 1\nformat = "other"\n' + SEGMENT, "key 'format'"),
        ("period = 1\n" + SEGMENT + "[[islands]]\nloop = 1", r"islands\[0\]: missing key 'pieces'"),
        ('period = 1\n[[pieces]]\nkind = "arc"\ncenter = [0.5, 0]\nangles = [3.14, 6.28]', "missing key 'semi_axes'"),
        (
            'period = 1\n[[pieces]]\nkind = "arc"\ncenter = [0.5, 0]\nsemi_axes = 0.5\nangles = [3.2, 6.2]\n'
            "start = [0, 0]",
            "missing key 'end'",
        ),
        ('period = 1\n[[pieces]]\nkind = "bezier"\ncontrol_points = [[0, 0], [1, 0]]', "3 or 4 points"),
    ],
)
def test_unsuitable_files_are_refused_with_file_and_key(text, words, tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        geo.load_wall(file)
    assert "bad.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_a_wall_that_breaks_a_condition_is_named_with_its_file(tmp_path):
    file = tmp_path / "crossed.toml"
    file.write_text("period = 1\nvertices = [[0, 0], [0.7, -0.5], [0.3, -0.5], [1, 0]]")
    with pytest.raises(WallError, match=r"crossed\.toml: piece 0 and piece 2"):
        geo.load_wall(file)


def test_missing_and_binary_files_are_input_errors(tmp_path):
    with pytest.raises(InputError, match="no_such"):
        geo.load_wall(tmp_path / "no_such.toml")
    with pytest.raises(InputError, match="no_such"):
        geo.read_profile(tmp_path / "no_such.txt")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.toml: cannot read it .*utf-8.*; expected a file of text"):
        geo.load_wall(tmp_path / "binary.toml")


def test_walls_are_found_by_name_and_parameters():
    for name, entry in geo.WALLS.items():
        assert geo.wall_from_text(name) == entry.build()
    assert geo.wall_from_text("focusing-arcs:half_angle=0.9") == geo.focusing_arcs(0.9)
    assert geo.wall_from_text("Focusing_Arcs: half-angle = 0.9") == geo.focusing_arcs(0.9)
    assert geo.wall_from_text("mushrooms:stem_to_cap=.3,stem_aspect=1,generations=2") == geo.mushrooms(0.3, 1.0, 2)
    elliptical = geo.wall_from_text("elliptical-arcs:half_angle=0.5,mass=2,inertia=0.7")
    assert elliptical == geo.elliptical_arcs(0.5, geo.Disk(2.0, 0.7))


def test_walls_are_found_by_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    geo.focusing_arcs(0.5).save("arc.toml")
    assert geo.wall_from_text("arc.toml") == geo.focusing_arcs(0.5)
    assert geo.wall_from_text(str(tmp_path / "arc.toml")) == geo.focusing_arcs(0.5)
    (tmp_path / "scan.txt").write_text("0 1\n1 2\n3 0\n")
    assert geo.wall_from_text("scan.txt") == geo.Wall.from_profile([0, 1, 3], [1, 2, 0])
    assert geo.wall_from_text("scan.txt:seam=step") == geo.Wall.from_profile([0, 1, 3], [1, 2, 0], "step")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("focusing-arc", "Did you mean focusing-arcs.*triangular-teeth"),
        ("qqq", "neither a named wall nor a file.*koch"),
        ("", "neither"),
        ("focusing-arcs:half_angel=1", "did you mean half_angle"),
        ("flat:angle=1", "it has none"),
        ("focusing-arcs:half_angle=wide", "expected a number, got 'wide'"),
        ("koch:generations=1.5", "expected a whole number"),
        ("focusing-arcs:0.9", "parameter=value"),
        ("focusing-arcs:half_angle=1,half_angle=2", "twice"),
        ("focusing-arcs:half_angle=9", "half_angle"),
        ("arc.toml:seam=step", "arc.toml: unknown parameter 'seam'"),
        ("scan.txt:angle=2", "scan.txt: unknown parameter 'angle'"),
        ("scan.txt:seam=glue", "scan.txt: seam"),
        ("bad.txt", "bad.txt: x: expected strictly increasing"),
    ],
)
def test_unknown_walls_are_refused_in_one_line(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    geo.flat().save("arc.toml")
    (tmp_path / "scan.txt").write_text("0 1\n1 2\n3 0\n")
    (tmp_path / "bad.txt").write_text("0 1\n1 2\n1 0\n")
    with pytest.raises(InputError, match=words) as caught:
        geo.wall_from_text(text)
    assert "\n" not in str(caught.value)
