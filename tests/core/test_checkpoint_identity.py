"""Checkpoints: what tells computations apart, in every process, and files that were changed or cut off."""

import inspect
import math
import sqlite3
import sys
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from asperity.core.contents import content
from asperity.core.estimates import Estimate
from asperity.core.long_runs import all_parts
from asperity.spectral.sweeps import running
from commands import ended, environment

SCALE = 0.5
TABLE = {"low": [0.25, 0.5]}
DISK, OTHER_DISK = geo.Disk(1.0, 0.5), geo.Disk(1.0, 0.25)
SWAP, CYCLE = [[0.0, 1.0], [1.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]


def tilted(weight, theta, outgoing):
    return 0.5 * np.sin(outgoing) * (1.0 + weight * np.cos(theta) * np.cos(outgoing))


def even(theta, outgoing):
    return tilted(0.0, theta, outgoing)


def scaled(theta, outgoing):
    return tilted(SCALE, theta, outgoing)


def helped(theta, outgoing):
    return scaled(theta, outgoing)


def weighted(weight):
    def density(theta, outgoing):
        return tilted(weight, theta, outgoing)

    return density


def by_default(theta, outgoing, weight=0.5):
    return tilted(weight, theta, outgoing)


class Diffuse(ker.Law):
    """A law of one's own, with data of its own."""

    def __init__(self, share):
        self.share = share

    def _sample(self, theta, rng):
        return np.where(rng.random(theta.shape) < self.share, np.arccos(rng.uniform(-1.0, 1.0, theta.shape)), theta)

    def _conditionals(self, *wanted):
        return (self.share * ker.lambertian() + (1.0 - self.share) * ker.retroreflection()).conditionals(*wanted)


def laws():
    """Every public law, in pairs and more of different ones that are printed alike where there are such."""
    arcs = geo.focusing_arcs(0.9), geo.focusing_arcs(0.8)
    teeth = geo.triangular_teeth(0.7), geo.triangular_teeth(0.7000000001)
    found = [
        ker.specular(), ker.retroreflection(), ker.lambertian(), ker.maxwell(0.5), ker.maxwell(0.25),
        ker.henyey_greenstein(0.5), ker.henyey_greenstein(0.25), ker.MatrixLaw(SWAP), ker.MatrixLaw(np.eye(2)),
        ker.MatrixLaw(CYCLE), ker.MatrixLaw(np.transpose(CYCLE)), ker.DensityLaw(even), ker.DensityLaw(scaled),
        ker.DensityLaw(lambda theta, outgoing: tilted(0.5, theta, outgoing)),
        ker.DensityLaw(lambda theta, outgoing: tilted(0.25, theta, outgoing)),
        ker.DensityLaw(weighted(0.5)), ker.DensityLaw(weighted(0.25)), ker.DensityLaw(by_default),
        ker.DensityLaw(partial(by_default, weight=0.25)),
        *(ker.IntervalExchangeLaw(ker.discretise(ker.MatrixLaw(array), ker.Bins(2))) for array in (SWAP, np.eye(2))),
        ker.InvolutionLaw(lambda theta: math.pi - theta), ker.InvolutionLaw(lambda theta: theta),
        ker.CircularArcLaw(1.1), ker.CircularArcLaw(1.2), ker.RectangularTeethLaw(1.0), ker.RectangularTeethLaw(1.5),
        ker.TriangularTeethLaw(0.5), ker.TriangularTeethLaw(0.6), ker.LeastResistanceLaw(),
        *(ker.MushroomLaw(geo.MushroomGenerations(0.25, 0.5, n)) for n in (40, 41)),
        *(ker.WallLaw(wall) for wall in (*arcs, *teeth)), *(ker.PolygonLaw(wall) for wall in teeth),
        Diffuse(0.5), Diffuse(0.25),
    ]  # fmt: skip
    first, second = ker.MatrixLaw(SWAP), ker.MatrixLaw(np.eye(2))
    for one in (first, second):
        found += [
            0.5 * one + 0.5 * ker.lambertian(), 0.25 * one + 0.75 * ker.lambertian(), one @ ker.specular(),
            (one @ ker.specular()) ** 2, one.in_specular_frame(),
            0.5 * one + 0.5 * ker.specular(),
        ]  # fmt: skip
    return found


def others():
    """Walls, bases, containers, disks, collision laws, families and quantities."""
    teeth = ker.TriangularTeethLaw(0.5), ker.TriangularTeethLaw(0.6)
    along = [ker.PositionLaw([0.0, 0.5, 1.0], [ker.MatrixLaw(SWAP), law]) for law in teeth]
    walls = [geo.triangular_teeth(0.5), geo.focusing_arcs(0.9), geo.mushrooms(0.2, 0.5, 1), geo.flat()]
    return [
        *walls, ker.Bins(4), ker.Bins(5), ker.Bins(4, weight="sin2"), ker.Bins([0.0, 1.0, math.pi]),
        ker.Bins([0.0, 1.5, math.pi]), ker.Legendre(4), ker.Legendre(5), ker.Panels([0.0, 1.0, math.pi], 2),
        ker.Panels([0.0, 1.5, math.pi], 2), ker.Panels([0.0, 1.0, math.pi], 3),
        ker.TensorBasis((ker.Bins(4), ker.Bins(3, weight="sin2"))), DISK, OTHER_DISK,
        geo.Container.strip(), geo.Container.circle(1.0), geo.Container.circle(2.0),
        ker.no_slip(DISK), ker.smooth(DISK), ker.no_slip(OTHER_DISK),
        *(ker.CollisionLaw(ker.MatrixLaw(array), DISK) for array in (SWAP, np.eye(2))),
        ker.CollisionLaw(ker.MatrixLaw(SWAP), OTHER_DISK), *(ker.CollisionAlongWall(law, DISK) for law in along),
        ker.SatelliteLaw(walls[0], DISK, 1e-3), ker.SatelliteLaw(walls[0], DISK, 1e-4),
        *(partial(geo.random_wall, geo.HeightCorrelation(0.1), n, rms_slope=0.1) for n in (32, 64)),
        geo.focusing_arcs, ker.maxwell, ker.resistance, Halved(0.5), Halved(0.25), Halved(0.5).found, Diffuse,
    ]  # fmt: skip


class Halved:
    """A quantity of one's own, with data."""

    def __init__(self, factor):
        self.factor = factor

    def __call__(self, law):
        return Estimate(self.factor, 0.0, "bound", "given")

    def found(self, law):
        return self(law)


def functions():
    """Functions that differ in a constant, a default, a closure, a global or a helper."""
    return [
        even, scaled, helped, by_default, weighted(0.5), weighted(0.25), weighted(np.zeros(2)), weighted(np.ones(2)),
        partial(by_default, weight=0.5), partial(by_default, weight=0.25), lambda: TABLE["low"], lambda: TABLE["high"],
        lambda: 1, lambda: 1.0, lambda: True, lambda: (1, 2), lambda: np.sin, lambda: np.cos, np.sin, np.cos, math.sin,
        lambda: [x + 1 for x in TABLE], lambda: [x + 2 for x in TABLE], Diffuse(0.5)._sample, Diffuse(0.25)._sample,
        np.random.default_rng(1), np.random.default_rng(2), np.random.SeedSequence(1), np.random.SeedSequence(2),
        lambda x, *, y=1: x, lambda x, *, y=2: x, weighted(weighted(0.5)), weighted(weighted(0.25)),
    ]  # fmt: skip


def all_contents():
    return [content(one) for one in (*laws(), *others(), *functions())]


def test_different_objects_have_different_contents():
    everything = [*laws(), *others(), *functions()]
    found = [content(one) for one in everything]
    same = [(everything[i], everything[j]) for i, j in combinations(range(len(found)), 2) if found[i] == found[j]]
    assert same == []


def test_the_same_objects_made_again_in_other_processes_have_the_same_contents(tmp_path):
    here = all_contents()
    assert here == all_contents()
    program = "import test_checkpoint_identity as own; print(' '.join(own.all_contents()))"
    folder = Path(__file__).resolve().parent
    for seed in ("1", "2"):
        done = ended("-c", program, cwd=tmp_path, env=environment(folder, PYTHONHASHSEED=seed), check=True)
        assert done.stdout.split() == here


def test_contents_of_sets_do_not_depend_on_the_order_and_those_of_circles_end():
    assert content({"a", "b", "c"}) == content({"c", "a", "b"}) != content({"a", "b"})
    circle: list[object] = [1]
    circle.append(circle)
    other: list[object] = [2]
    other.append(other)
    assert content(circle) != content(other)
    assert (
        len({content(x) for x in (1, 1.0, True, "1", b"1", np.float64(1.0), np.ones(()), (1,), [1], {1}, {1: 1})}) == 11
    )
    ones = [np.ones(4), np.ones((2, 2)), np.ones(4, dtype=np.float32), np.zeros(4), (1.0, 1.0, 1.0, 1.0)]
    assert len({content(one) for one in ones}) == len(ones)


def test_use_does_not_change_the_content():
    for law in laws():
        before = content(law)
        ker.discretise(law, ker.Bins(4), tolerance=0.1, samples=2**12)
        law.sample(np.linspace(0.5, 2.5, 5), rng=1)
        repr(law), law.reversible, law.mirror_symmetric
        assert content(law) == before, law


def test_a_changed_global_helper_module_or_class_changes_the_content(monkeypatch, tmp_path):
    before = [content(one) for one in (scaled, helped, even)]
    monkeypatch.setitem(globals(), "SCALE", 0.25)
    after = [content(one) for one in (scaled, helped, even)]
    assert [one == other for one, other in zip(before, after, strict=True)] == [False, False, True]
    (tmp_path / "own_settings.py").write_text("FACTOR = 1.0\nOTHER = 2.0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import own_settings

    def outside(law):
        return own_settings.FACTOR

    def inside(law):
        from own_settings import FACTOR

        return FACTOR

    found = [content(outside), content(inside)]
    monkeypatch.setattr(own_settings, "OTHER", 3.0)
    assert found == [content(outside), content(inside)]
    monkeypatch.setattr(own_settings, "FACTOR", 3.0)
    assert not {*found} & {content(outside), content(inside)}
    law = content(Diffuse(0.5))
    monkeypatch.setattr(Diffuse, "_conditionals", lambda self, *wanted: None)
    assert content(Diffuse(0.5)) != law


# ---- every function that takes a checkpoint ----------------------------------------------------------------------
def estimate(value):
    def found(law):
        return Estimate(value, 0.0, "bound", "given")

    return found


def family(share):
    def made(rng):
        return ker.MatrixLaw([[share, 1.0 - share], [1.0 - share, share]])

    return made


def walls(share):
    return lambda angle: ker.DensityLaw(weighted(share)) if angle < 0.0 else ker.maxwell(0.5)


PAIRS = (np.array([0.5, 1.0, 2.0, 2.5]), np.array([0.5, 2.0, 1.0, 2.5]))
FLIGHT = {"position": [0.0, 0.0], "velocity": [1.0, 1.0, 0.0], "collisions": 3, "rng": 1}
SMALL = {"samples": 2**10, "rng": 1, "method": "monte-carlo"}
SHORT = {"samples": (2, 3, 4), "repetitions": 2, "rng": 1}
LENGTHS = [2.0, 4.0, 8.0]


def own_spacing(factor):
    return lambda eps: 2.0 * math.pi / math.ceil(factor / eps**0.4)


# of each function two calls of different computations that are printed alike
CALLS = {
    "kernels.discretise": [
        partial(ker.discretise, ker.DensityLaw(weighted(share)), ker.Bins(4), **SMALL) for share in (0.5, 0.25)
    ],
    "kernels.play": [
        partial(ker.play, geo.Container.strip(), ker.CollisionLaw(ker.MatrixLaw(array), DISK), **FLIGHT)
        for array in (SWAP, np.eye(2))
    ],
    "kernels.play_gas": [
        partial(
            ker.play_gas,
            geo.Torus(8.0, 8.0),
            ker.PairLaw(ker.MatrixLaw(array), DISK, DISK),
            [[2.0, 2.0], [6.0, 2.5]],
            [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
            6,
            rng=1,
        )
        for array in (SWAP, np.eye(2))
    ],
    "kernels.limit_study": [
        partial(ker.limit_study, DISK, geo.triangular_teeth(0.7), [1e-3, 1e-4, 1e-5], spacing=own_spacing(x), **SHORT)
        for x in (5.0, 5.5)
    ],
    "kernels.estimate_stream": [
        partial(ker.estimate_stream, pairs, ker.Bins([0.0, 1.2, math.pi]), invariant=False)
        for pairs in ([PAIRS] * 20, [PAIRS[::-1]] * 20)
    ],
    "spectral.exit_times": [partial(spec.exit_times, Diffuse(share), LENGTHS, 20, 1) for share in (0.5, 0.75)],
    "spectral.sweep": [
        partial(spec.sweep, walls(0.5), {"angle": [0.5, 1.0]}, Halved(factor).found) for factor in (0.5, 0.25)
    ],
    "spectral.ensemble": [partial(spec.ensemble, family(share), 4, estimate(0.5)) for share in (0.5, 0.25)],
    "spectral.mean_law": [partial(spec.mean_law, family(share), 4, ker.Bins(2)) for share in (0.5, 0.25)],
}


def takes_checkpoints():
    for room, module in (("geometry", geo), ("kernels", ker), ("spectral", spec)):
        for name in dir(module):
            one = getattr(module, name)
            parameters = inspect.signature(one).parameters if inspect.isfunction(one) else {}
            if "checkpoint" in parameters or "engine" in parameters:
                yield f"{room}.{name}", parameters


def test_every_function_that_takes_a_checkpoint_is_here_and_takes_a_key():
    found = dict(takes_checkpoints())
    assert set(found) == set(CALLS)
    assert all("key" in parameters or "engine" in parameters for parameters in found.values())


def told(found):
    """All fields to the last bit."""
    if is_dataclass(found) and not isinstance(found, Sequence):
        return {one.name: told(getattr(found, one.name)) for one in fields(found) if one.repr}
    if isinstance(found, np.ndarray):
        return found.shape, found.tobytes()
    return [told(one) for one in found] if isinstance(found, Sequence) and not isinstance(found, str) else repr(found)


@pytest.mark.parametrize("name", CALLS)
def test_the_checkpoint_of_one_computation_is_its_own_and_never_taken_for_another(name, tmp_path):
    one, other = CALLS[name]
    first, again = (one(checkpoint=tmp_path / "a") for _ in range(2))
    assert told(first) == told(again)
    with pytest.raises(InputError, match="is the checkpoint of something else"):
        other(checkpoint=tmp_path / "a")
    with pytest.raises(InputError, match="key: null there, 'mine' here"):
        one(checkpoint=tmp_path / "a", key="mine")


def test_what_has_no_content_is_refused_and_the_advice_works(tmp_path):
    with (tmp_path / "notes").open("w") as notes:

        def told(law):
            notes.write("seen")
            return Estimate(0.5, 0.0, "bound", "given")

        asked = {"family": ker.maxwell, "grid": {"diffuse_fraction": [0.25, 0.5]}, "quantities": told}
        with pytest.raises(InputError, match=r'quantities: .*TextIOWrapper.* has no content .*; pass key="\.\.\."'):
            spec.sweep(**asked, checkpoint=tmp_path / "a")
        assert not (tmp_path / "a").exists()
        table = spec.sweep(**asked, checkpoint=tmp_path / "a", key="notes")
        assert spec.sweep(**asked, checkpoint=tmp_path / "a", key="notes") == table
        with pytest.raises(InputError, match="key: 'notes' there, 'others' here"):
            spec.sweep(**asked, checkpoint=tmp_path / "a", key="others")
    twice = np.frompyfunc(lambda x: 2 * x, 1, 1)
    for foreign in (twice, sys.stdout, (x for x in ()), sqlite3.connect(":memory:"), memoryview(b"a")):
        with pytest.raises(TypeError):
            content(foreign)
        assert content(foreign, by_name=True)
    with pytest.raises(InputError, match="key: expected a name"):
        Checkpoint(tmp_path / "b", {}, key="")


def test_a_key_stands_for_functions_but_not_for_data(tmp_path):
    first, second = (content(weighted(weight), by_name=True) for weight in (0.5, 0.25))
    assert first == second
    assert content(ker.MatrixLaw(SWAP), by_name=True) != content(ker.MatrixLaw(np.eye(2)), by_name=True)


# ---- damaged contents --------------------------------------------------------------------------------------------
def rewritten(path, change):
    """Replace every part by what ``change`` makes of it, with a digest that fits."""
    import hashlib

    with sqlite3.connect(path) as file:
        for key, value in file.execute("SELECT key, value FROM parts").fetchall():
            new = change(value)
            coded = new.encode() if isinstance(new, str) else new
            told = hashlib.sha256(key.encode() + b"\0" + coded).hexdigest()
            file.execute("UPDATE parts SET value = ?, digest = ? WHERE key = ?", (new, told, key))
    file.close()


def array_changes(arrays, rng):
    """An array of a part with another kind, another shape, no number or one out of range; or too few or many."""
    name = rng.choice(sorted(arrays))
    array = arrays[name]
    choice = int(rng.integers(6))
    if choice == 0:
        array = np.ones(array.shape, dtype=np.complex128)
    elif choice == 1:
        array = array[None]
    elif choice == 2 and array.dtype.kind == "f":
        array = np.full_like(array, np.nan)
    elif choice == 3 and array.dtype.kind in "iu":
        array = np.full_like(array, -5 if array.dtype.kind == "i" else np.iinfo(array.dtype).max)
    elif choice == 4:
        return {key: value for key, value in arrays.items() if key != name}
    else:
        return {**arrays, "more": np.zeros(1)}
    return {**arrays, name: array}


@pytest.mark.parametrize("name", [name for name in CALLS if name not in ("spectral.sweep", "spectral.ensemble")])
def test_parts_that_are_not_what_they_must_be_are_refused(name, tmp_path):
    rng, path = np.random.default_rng(1), tmp_path / "a"
    CALLS[name][-1](checkpoint=path)
    whole = path.read_bytes()
    for _ in range(12):
        rewritten(path, lambda value: packed_arrays(array_changes(unpacked_arrays(value), rng)))
        with pytest.raises(InputError, match="is damaged"):
            CALLS[name][-1](checkpoint=path)
        path.write_bytes(whole)
    for change in (lambda value: b"PK", lambda value: b"\x93NUMPY", lambda value: value[:-20]):
        rewritten(path, change)
        with pytest.raises(InputError, match="is damaged"):
            CALLS[name][-1](checkpoint=path)
        path.write_bytes(whole)


@pytest.mark.parametrize(
    ("old", "new"),
    [("0.5, 0.0", "NaN, 0.0"), ("0.5, 0.0", "0.5, -1.0"), ("0.5, 0.0", '"0.5", 0.0'), ("bound", "sure"),
     ('"given"', "null"), ("[[[", "[[[9.0, "), ('"found"', '"other"'), ("]]", "], 1]"), ("0.5, 0.0", "null, 0.0")],
)  # fmt: skip
def test_rows_of_a_sweep_that_are_not_what_they_must_be_are_refused(tmp_path, old, new):
    run = partial(spec.sweep, ker.maxwell, {"diffuse_fraction": [0.25, 0.75]}, estimate(0.5), checkpoint=tmp_path / "a")
    run()
    rewritten(tmp_path / "a", lambda text: text.replace(old, new))
    with pytest.raises(InputError, match="is damaged"):
        run()


def test_compressed_parts_and_numbers_out_of_range_are_refused():
    import io

    file = io.BytesIO()
    np.savez_compressed(file, times=np.zeros(4))
    with pytest.raises(ValueError, match="compressed"):
        unpacked_arrays(file.getvalue())
    for array in (np.array([-1.0]), np.array([math.inf]), np.array([math.nan]), np.array([3.0])):
        with pytest.raises(ValueError, match="outside"):
            unpacked_arrays(packed_arrays({"times": array}), {"times": Stored("f", (1,), 0.0, 2.0)})


def test_a_family_that_refuses_its_walls_is_told_by_its_reasons(tmp_path):
    made = [running._made(ker.maxwell, {"diffuse_fraction": share}, by_name=False) for share in (2.0, 3.0)]
    assert made[0].startswith("refused: ") and made[0] != made[1]


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
