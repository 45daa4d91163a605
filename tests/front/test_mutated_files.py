"""Damaged files: the faults that began the campaign campaigns/faults/damaged_files.py."""

import json
import tracemalloc
import warnings
import zipfile
from io import BytesIO

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError, WallError
from asperity.estimates import Estimate

EXACT = ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(6))


def changed(path, **record):
    """The file with changed values of its record."""
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["record"] = np.array(json.dumps(json.loads(str(arrays["record"])) | record))
    np.savez_compressed(path, **arrays)
    return path


@pytest.mark.parametrize(
    "record",
    [
        {"error": [float("nan"), 0.0, "bound", ""]}, {"error": [0.5, 0.0, "bound", ""]}, {"law": 3}, {"law": None},
        {"law": ["a"]}, {"method": {}}, {"samples": 10**30}, {"unresolved": True}, {"unresolved": "0.0"},
        {"symmetrised": 1}, {"requested_tolerance": float("nan")}, {"norm_bound": float("inf")},
        {"metadata": [["a", 1]]}, {"raw_defect": [float("nan"), "a", None]}, {"raw_defect": [0.1, 3, None]},
        {"replicates": ["fog"]},
    ],
)  # fmt: skip
def test_every_field_of_a_matrix_is_checked(tmp_path, record):
    path = changed(EXACT.save(tmp_path / "kernel.npz"), **record)
    with pytest.raises(InputError, match=r"kernel\.npz is not a kernel matrix"):
        ker.load_matrix(path)


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"law": 3}, "law"), ({"method": None}, "method"), ({"metadata": 3}, "metadata"), ({"frame": "lab"}, "frame"),
        ({"reversible": "yes"}, "reversible"), ({"counts": np.full((2, 2), 0.5)}, "counts"),
        ({"unresolved": np.nan}, "unresolved"), ({"samples": 0.5}, "samples"),
    ],
)  # fmt: skip
def test_no_matrix_is_made_with_a_field_that_no_file_holds(fields, name):
    nothing = Estimate(0.0, 0.0, "bound", "given")
    with pytest.raises(InputError, match=rf"^{name}: expected"):
        ker.KernelMatrix(np.eye(2), ker.Bins(2), nothing, **fields)
    with pytest.raises(InputError, match=r"^error: expected"):
        ker.KernelMatrix(np.eye(2), ker.Bins(2), Estimate(np.nan, 0.0, "bound", "given"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["symmetric", "counts", "basis", "record", "none"])
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA])
def test_no_member_is_inflated_before_its_header_is_checked(tmp_path, name, method):
    path = ker.discretise(ker.lambertian(), ker.Bins([0.0, 1.0, np.pi])).save(tmp_path / "kernel.npz")
    with zipfile.ZipFile(path) as archive:
        members = {one: archive.read(one) for one in archive.namelist()}
    bomb = BytesIO()
    np.save(bomb, np.zeros((2000, 2000)) if name != "record" else np.array("a" * 2 * 10**7))
    members[f"{name}.npy"] = bomb.getvalue()
    with zipfile.ZipFile(path, "w", method) as archive:
        for one, data in members.items():
            archive.writestr(one, data)
    del members, bomb
    tracemalloc.start()
    try:
        if name == "none" and method == zipfile.ZIP_DEFLATED:
            assert ker.load_matrix(path).size == 2
        else:
            with pytest.raises(InputError, match="is not a kernel matrix"):
                ker.load_matrix(path)
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("size", [1e101, 1e308])
@pytest.mark.parametrize("vertices", ["[0.5, -{}]", "[{}, -0.5]", "[-{}, -1]"])
def test_a_vertex_beyond_all_walls_is_refused_without_a_warning(tmp_path, vertices, size):
    path = tmp_path / "wall.toml"
    path.write_text(f"period = 1.0\nvertices = [[0, 0], {vertices.format(size)}, [1, 0]]")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(WallError, match=r"finite coordinates of at most 1e\+100"):
            geo.load_wall(path)


@pytest.mark.parametrize("control", [1e15, 1e30, 1e90])
def test_a_bezier_piece_with_a_far_control_point_takes_little_memory(control):
    tracemalloc.start()
    try:
        with pytest.raises(WallError, match="rises to"):
            geo.Wall([geo.Bezier([(0, 0), (0.5, control), (0.6, -1), (1, 0)])])
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("word", ["1e400", "-1e400", "1_0", "1e308", "0x10", "١"])
def test_a_word_that_is_no_number_is_no_undefined_height(tmp_path, word):
    (tmp_path / "scan.txt").write_text(f"0 1\n1 {word}\n2 1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line 2: expected two numbers|at most 1e\+100"):
        geo.read_profile(tmp_path / "scan.txt")
