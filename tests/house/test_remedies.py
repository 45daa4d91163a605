"""What messages advise works: every call that a message of the library names is run."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.spatial
import sympy as sp

import asperity
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import MAKES
from asperity.errors import AsperityError, FileExistsRefusal, InputError
from asperity.estimates import Estimate

ROOT = Path(asperity.__file__).parent
RAISED = {"InputError", "WallError", "FileExistsRefusal", "AccuracyError", "warn"}
# Checks whose last argument is an example.
DOORS = {"instance", "sequence"}
ADVICE = re.compile(r"\b(pass|use|take|give|call|write|for example|such as)\b", re.IGNORECASE)
X, H = np.linspace(0.0, 1.0, 5), np.array([0.0, 0.2, 0.1, 0.3, 0.0])
BOX = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
DISK, LAW, WALL, P = geo.Disk(), ker.lambertian(), geo.koch(1), ker.discretise(ker.lambertian(), ker.Bins(4))
SPECULAR, Z = LAW.in_specular_frame(), sp.Symbol("z")
CUSP = geo.Bezier([(-1, 0), (1, 1), (-1, 1), (1, 0)])
ROOF = (geo.Segment((1, 0), (0, 3)), geo.Segment((0, 3), (-1, 0)))
FACETED = ker.FacetedLaw(WALL, ker.maxwell(0.2))

# A part of the message, the call that it refuses, and the one that it advises.
REMEDIES = {
    "write sympy.Ne(x, 1)": (
        lambda: asperity.verify(Z, Z, [Z != 1]),
        lambda: asperity.verify(Z, Z, [sp.Ne(Z, 1)]),
    ),
    "pass both sides, or sympy.Eq": (
        lambda: asperity.verify((Z + 1) ** 2 == Z**2 + 2 * Z + 1),
        lambda: (asperity.verify(Z * Z, Z**2), asperity.verify(sp.Eq((Z + 1) ** 2, Z**2 + 2 * Z + 1))),
    ),
    "pass the places of jumps as breakpoints, or a tolerance above": (
        lambda: geo.Wall.from_function(lambda x: np.where(x < 0.3, 0.0, x - 0.3)),
        lambda: (
            geo.Wall.from_function(lambda x: 1e6 + np.cos(2 * np.pi * x), tolerance=1e-6),
            geo.Wall.from_function(lambda x: np.where(x < 0.3, 0.0, x - 0.3), breakpoints=[0.3]),
            geo.Wall([geo.Arc((0.5, 0.0), 0.5, np.pi, 2 * np.pi)]),
        ),
    ),
    "use Profile.interpolated()": (
        lambda: geo.Wall.from_profile([0, 1, 2], [0, np.nan, 0.5]),
        lambda: geo.Wall.from_profile(geo.Profile([0, 1, 2], [0, np.nan, 0.5]).interpolated()),
    ),
    "use Profile.sorted()": (
        lambda: geo.Wall.from_profile([0, 2, 1], [0, 1, 2]),
        lambda: geo.Wall.from_profile(geo.Profile([0, 2, 1], [0, 1, 2]).sorted()),
    ),
    "pass seam='step'": (
        lambda: geo.Wall.from_profile([0, 1, 3], [0, 0.5, 0.2], seam="wrap"),
        lambda: geo.Wall.from_profile([0, 1, 3, 4], [0, 0.5, 0.2, 0], seam="step"),
    ),
    "pass Wall.from_profile(*numpy.asarray(table).T)": (
        lambda: geo.Wall.from_profile(np.c_[X, H]),
        lambda: geo.Wall.from_profile(*np.asarray(np.c_[X, H]).T),
    ),
    "for all pairs pass": (
        lambda: geo.trace(WALL, X[1:4], [0.5, 1.0]),
        lambda: geo.trace(WALL, X[1:4][:, None], [0.5, 1.0]),
    ),
    "divide it by its integral, or give angles beside a peak": (
        lambda: ker.Conditionals.of_density(lambda a, b: np.sin(b), [1.0], 2, ()),
        lambda: ker.Conditionals.of_density(lambda a, b: np.sin(b) / 2.0, [1.0], 2, ()),
    ),
    "give the angles where it is not smooth as edges=": (
        lambda: LAW.apply(lambda x: np.floor(2000.0 * x), 1.0),
        lambda: LAW.apply(lambda x: np.floor(2000.0 * x), 1.0, edges=np.arange(1.0, 6284.0) / 2000.0),
    ),
    "and divide x1 by the radius": (
        lambda: geo.collide(geo.Disk(radius=2.0), WALL, 1e-3, [[2.0, 0.0]], [[0.0, -1.0, 0.0]]),
        lambda: geo.collide(geo.Disk(1.0, 0.5, 1.0), WALL, 1e-3, [[1.0, 0.0]], [[0.0, -1.0, 0.0]]),
    ),
    "geo.Disk.from_inertia(": (
        lambda: geo.Disk(2.0, inertia=4.0, radius=2.0),
        lambda: geo.Disk.from_inertia(2.0, 4.0, 2.0),
    ),
    "pass the period or complete the path": (
        lambda: geo.Wall([geo.Segment((0, 0), (2, 0))]),
        lambda: geo.Wall([geo.Segment((0, 0), (2, 0))], 2.0),
    ),
    "pass minus the velocity of an incoming disk": (
        lambda: DISK.to_angles((0.1, -1.0, 0.2)),
        lambda: DISK.to_angles((-0.1, 1.0, -0.2)),
    ),
    "pass a larger stem_aspect": (
        lambda: geo.mushrooms(generations=2, stem_aspect=0.0),
        lambda: geo.mushrooms(generations=2, stem_aspect=1.0),
    ),
    "pass ker.CollisionLaw(law, disk), or ker.smooth(disk) and ker.no_slip(disk)": (
        lambda: ker.play(geo.Container.circle(), LAW, [0.0, 0.0], [0.1, 1.0, 0.2], 3),
        lambda: [ker.CollisionLaw(LAW, DISK), ker.smooth(DISK), ker.no_slip(DISK)],
    ),
    "pass points[scipy.spatial.ConvexHull(points).vertices]": (
        lambda: ker.RoughBody.polygon(LAW, np.tile(BOX, (2, 1))),
        lambda: ker.RoughBody.polygon(LAW, BOX[scipy.spatial.ConvexHull(np.tile(BOX, (2, 1))).vertices]),
    ),
    "pass both parts of curve.split(": (
        lambda: geo.Container.from_curves([CUSP, *ROOF]),
        lambda: geo.Container.from_curves([*CUSP.split(0.5), *ROOF]),
    ),
    "for one of a matrix on bins pass ker.discretise(law, ker.Bins(64))": (
        lambda: spec.mixing_time(ker.henyey_greenstein(0.5), start="worst"),
        lambda: spec.mixing_time(ker.discretise(ker.henyey_greenstein(0.5), ker.Bins(64)), start="worst"),
    ),
    "use P.tensor(Q)": (lambda: ker.discretise(LAW, ker.TensorBasis((ker.Bins(2), ker.Bins(2)))), lambda: P.tensor(P)),
    "use kind='pseudometric'": (
        lambda: ker.distance(*2 * (ker.discretise(LAW, ker.Legendre(4)),)),
        lambda: ker.distance(*2 * (ker.discretise(LAW, ker.Legendre(4)),), kind="pseudometric"),
    ),
    "use sample(), apply() or discretise()": (
        lambda: LAW.branches(1.0),
        lambda: (LAW.sample([1.0]), LAW.apply(np.cos, [1.0]), ker.discretise(LAW, ker.Bins(2))),
    ),
    "use in_specular_frame() on one": (
        lambda: ker.distance(LAW, SPECULAR),
        lambda: ker.distance(LAW.in_specular_frame(), SPECULAR),
    ),
    "take section='channel'": (
        lambda: spec.transmission(LAW, 1.0, "tube", other=ker.specular()),
        lambda: spec.transmission(LAW, 1.0, other=ker.specular()),
    ),
    "call in_specular_frame() on one of them": (lambda: LAW @ SPECULAR, lambda: LAW @ SPECULAR.in_specular_frame()),
    "use in_specular_frame() on both or on neither": (
        lambda: P + P.in_specular_frame(),
        lambda: P.in_specular_frame() + P.in_specular_frame(),
    ),
    "use WallLaw(wall), which traces curves": (
        lambda: ker.PolygonLaw(geo.focusing_arcs()),
        lambda: ker.WallLaw(geo.focusing_arcs()),
    ),
    "or facets='finer grooves' if it keeps": (
        lambda: ker.HemisphereLaw(FACETED),
        lambda: [ker.HemisphereLaw(FACETED, facets=one) for one in ("diffuse in space", "finer grooves")],
    ),
    "pass facets='finer grooves', or add and multiply": (
        lambda: ker.HemisphereLaw(FACETED @ FACETED, facets="diffuse in space"),
        lambda: (
            ker.HemisphereLaw(FACETED @ FACETED, facets="finer grooves"),
            ker.HemisphereLaw(FACETED, facets="diffuse in space") @ ker.HemisphereLaw(FACETED, facets="finer grooves"),
        ),
    ),
    "use it with ker.HemisphereLaw(law)": (
        lambda: ker.discretise(LAW, ker.Zernike(2)),
        lambda: ker.discretise(ker.HemisphereLaw(LAW), ker.Zernike(2)),
    ),
    "use ker.discretise(H, ker.Zernike(": (
        lambda: ker.HemisphereLaw(LAW, 0.5).matrix(2, 1),
        lambda: ker.discretise(ker.HemisphereLaw(LAW, 0.5), ker.Zernike(2)),
    ),
    "Take a palindrome such as H1 @ H2 @ H1": (
        lambda: spec.spectral_gap(ker.HemisphereLaw(LAW) @ ker.HemisphereLaw(ker.specular())),
        lambda: spec.spectral_gap(ker.HemisphereLaw(LAW) @ ker.HemisphereLaw(ker.specular()) @ ker.HemisphereLaw(LAW)),
    ),
    "expected a name that ends in": (None, None),
    "pass overwrite=True to replace": (None, None),
}  # fmt: skip
# Advice that names no call to be run as it stands, or that other tests run.
EXPLAINED = {
    "write @dataclass(frozen=True), with eq=False": "test_rays.py does it",
    "pass spacing=1.0, or (dx, dy)": "test_reading.py of surfaces runs it",
    "Give units, for example units=": "test_profiles.py runs it",
    "give the gap a width": "no call",
    "take a smaller scale": "the limit is in the message",
    "the next generation needs room": "in the list above",
    "mushrooms in each flat top": "the limits depend on the machine's memory",
    "take fewer cells, or method='monte-carlo'": "the size depends on the machine's memory",
    "use KernelMatrix.adjoint()": "test_composed_laws.py runs it",
    "use discretise() and compose the matrices": "takes a million evaluations",
    "use discretise(law, basis) ** n": "takes a deep power",
    "samples that cover all angles": "no single call",
    "pass invariant=False": "test_pairs.py runs it",
    "write rng={} for a seed": "test_argument_doors.py runs it",
    'pass key="..."': "test_checkpoint_identity.py runs it",
    "or compute without client": "test_workers.py runs it",
    "chmod go-w": "a command of the shell; test_compilation.py makes such folders",
    "which traces with periodic wrap": "as for curves",
    "its symmetric half where it was sampled": "a formula",
    "use law.in_specular_frame()": "in the list above",
    "call in_specular_frame() on it": "in the list above",
    "spectrum(law) and spectral_gap(law) take its matrix": "test_enclosures.py runs it",
    "take one beside it": "no call",
    "use a .png, .pdf or .svg name": "test_study.py runs it",
    "pass time_limit=None": "test_verification.py runs it",
    "cannot write there": "another folder",
    "a relation such as a <= b": "words",
    "compose the law from specular() and retroreflection()": "words",
    "units of length such as ('um', 'nm')": "test_profiles.py runs it",
    "two numbers such as (0, 2)": "test_profiles.py runs it",
    "a list of walls such as [": "words",
    "Use law @ law.adjoint() if that is what you mean": "test_enclosures.py runs it",
    "is what you mean": "test_spectrum.py runs it",
}


def messages() -> list[str]:
    """The texts of all messages that advise a call, with braces for what is filled in."""
    found = []
    folders = [ROOT / name for name in ("geometry", "kernels", "spectral")]
    files = {file for folder in (ROOT, *map(Path.resolve, folders)) for file in folder.rglob("*.py")}
    for file in sorted(files):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            name = isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", ""))
            if (name in RAISED and node.args) or (name in DOORS and len(node.args) == 4):
                text = text_of(node.args[0]) if name in RAISED else f"such as {text_of(node.args[3])}"
                if ADVICE.search(text) and re.search(r"[(=]", text):
                    found.append(text)
    return found


def text_of(node: ast.expr) -> str:
    if isinstance(node, ast.JoinedStr):
        return "".join("{}" if isinstance(part, ast.FormattedValue) else str(part.value) for part in node.values)
    return str(node.value) if isinstance(node, ast.Constant) else ""


@pytest.mark.parametrize("words", [words for words, (mistake, _) in REMEDIES.items() if mistake is not None])
@pytest.mark.filterwarnings("ignore:the profile's")
def test_the_call_that_a_message_advises_works(words):
    mistake, advised = REMEDIES[words]
    with pytest.raises(AsperityError) as refused:
        mistake()
    assert words in str(refused.value)
    assert advised() is not None


def test_what_is_given_as_an_example_is_one():
    """Code after 'such as' is evaluated."""
    names = {
        **{name: getattr(room, name) for room in (geo, ker) for name in dir(room)},
        "Estimate": Estimate, "geo": geo, "ker": ker, "spec": spec, "wall": WALL, "law": LAW, "disk": DISK, "n": 3,
        "container": geo.Container.circle(), "laws": ker.smooth(DISK),
        "matrix": ker.discretise(ker.lambertian(), ker.Bins(4)), "position": [0.5, 0.0], "collisions": 3,
        "velocity": [0.0, 1.0, 0.0],
    }  # fmt: skip
    examples = {
        code
        for text in messages()
        for code in re.findall(r"such as ((?:geo\.|ker\.|spec\.)?[A-Za-z]+\.?\w*\(.*)", text)
    }
    assert len(examples) >= 20
    for example in examples:
        end = next(k for k in range(1, len(example) + 1) if example[:k].count("(") == example[:k].count(")") > 0)
        assert eval(example[:end], names) is not None


def test_every_message_that_advises_a_call_is_run_or_explained():
    known = [*REMEDIES, *EXPLAINED]
    example = re.compile(r"such as ((geo|ker|spec)\.)?[A-Za-z]\w+[.(]")
    missing = [text for text in messages() if not any(words in text for words in known) and not example.search(text)]
    assert missing == []


def test_the_names_that_are_advised_for_files_are_written(tmp_path):
    for save, name in ((P.save, "kern.mat"), (WALL.save, "wall.txt")):
        with pytest.raises(AsperityError, match="expected a name that ends in") as refused:
            save(tmp_path / name)
        advised = re.search(r"pass '(.*)'", str(refused.value))[1]
        Path(advised).write_text("precious")
        with pytest.raises(FileExistsRefusal, match="pass overwrite=True"):
            save(advised)
        assert Path(advised).read_text() == "precious"
        save(advised, overwrite=True)
        assert Path(advised).read_text(errors="replace") != "precious"


def test_a_refusal_of_another_kind_names_the_constructor_that_makes_the_wanted_one():
    wall, array, matrix, law = geo.koch(1), np.eye(2), P, LAW
    points, profile = [(0.0, 0.0), (0.5, -1.0), (1.0, 0.0)], geo.Profile([0, 1], [0, 1])
    given = {
        "wall": wall, "array": array, "matrix": matrix, "law": law, "text": "koch", "profile": profile, "ker": ker,
        "points": points, "density": lambda a, b: 0.5 * np.sin(b) + 0.0 * a, "map": lambda theta: np.pi - theta,
        "geo": geo,
    }  # fmt: skip
    kinds = {"Law": ker.Law, "Wall": geo.Wall, "KernelMatrix": ker.KernelMatrix}
    generations = geo.MushroomGenerations(0.25, 0.5, 2)
    for wanted, makes in MAKES.items():
        for kind, text in makes.items():
            for one in text.split(" or "):
                names = {**given, "wall": generations} if kind == "MushroomGenerations" else given
                owner = {"CollisionLaw": ker.CollisionLaw(law, DISK), "NamedWall": geo.WALLS["koch"]}
                found = eval(one.replace("its .", "own."), {**names, "own": owner.get(kind, ker.WallLaw(wall))})
                assert isinstance(found, kinds[wanted]), (wanted, kind, one)
    with pytest.raises(InputError, match=r"take ker\.WallLaw\(geo\.wall_from_text\(text\)\)"):
        ker.resistance("koch")
    for call in (spec.essential_edge, spec.mixing_time):
        with pytest.raises(InputError, match=r"take ker\.WallLaw\(wall\)"):
            call(wall)
    with pytest.raises(InputError, match=r"take ker\.discretise\(law, ker\.Bins\(64\)\)"):
        spec.conductance(law)
