"""The layout: folders lie on floors, imports go down and never round, and a listing tells where things are."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import asperity
from asperity import geometry, kernels, spectral

ROOT = Path(asperity.__file__).parent
TREE = Path(__file__).parents[2]
CONTRIBUTING = (TREE / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROOMS = ("geometry", "kernels", "spectral")
MOST_MODULES = 14
# Every folder once, from the ground up; a room's own names come after its folders.
FLOORS = [
    *("core", "verification"),
    *(
        "geometry.curves",
        "geometry.disk",
        "geometry.tables.compiled",
        "geometry.tables",
        "geometry.cells",
        "geometry.scene",
    ),
    *("geometry.scene.compiled", "geometry.walls"),
    *(
        "geometry.tracing.double_double",
        "geometry.tracing.compiled.pieces",
        "geometry.tracing.compiled",
        "geometry.tracing",
    ),
    *("geometry.surfaces.compiled", "geometry.surfaces"),
    *("geometry.polygons.compiled", "geometry.polygons", "geometry.itineraries.compiled", "geometry.itineraries"),
    *("geometry.plotting", "geometry.collisions.compiled", "geometry.collisions", "geometry"),
    *(
        "kernels.bases",
        "kernels.matrices",
        "kernels.expectations",
        "kernels.laws",
        "kernels.walls",
        "kernels.sampling",
    ),
    *("kernels.discretisation", "kernels.distances", "kernels.positions", "kernels.thermal", "kernels.collisions"),
    *("kernels.hemisphere", "kernels.billiards", "kernels.inverse", "kernels.aerodynamics", "kernels"),
    *("spectral.eigenvalues", "spectral.essential", "spectral.bounds", "spectral.gap", "spectral.consequences"),
    "spectral.proofs",
    *("spectral.sweeps", "spectral.work_diagrams", "spectral"),
    # the ledger's index finds the files of its folders without naming them
    *("ledger", "ledger.plane", "ledger.disk", "ledger.proof"),
    *("study", "bench", "explore"),
]
COMPILED = ("compiled", "double_double")


def modules() -> dict[str, Path]:
    """Every module by its dotted name below asperity; a package by its own."""
    found = {}
    for top, prefix in [(ROOT, ()), *((ROOT / room, (room,)) for room in ROOMS)]:
        for path in top.rglob("*.py"):
            parts = (*prefix, *path.relative_to(top).with_suffix("").parts)
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def is_package(name: str) -> bool:
    return MODULES[name].name == "__init__.py"


def folder_of(name: str) -> str:
    return name if is_package(name) else name.rpartition(".")[0]


def imports(name: str) -> Iterator[str]:
    """The modules of asperity that a module imports, also inside functions and for types alone."""
    package = folder_of(name).split(".") if folder_of(name) else []
    for node in ast.walk(TREES[name]):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        start = package[: len(package) - node.level + 1] + (node.module.split(".") if node.module else [])
        for alias in node.names:
            full = ".".join([*start, alias.name])
            yield full if full in MODULES else ".".join(start)


IMPORTS = {name: set(imports(name)) for name in MODULES}


def test_no_file_imports_itself_by_way_of_others():
    # raises a CycleError that names the files
    list(TopologicalSorter({name: found - {name, ""} for name, found in IMPORTS.items()}).static_order())


def test_imports_go_down():
    for name, targets in IMPORTS.items():
        for target in targets & MODULES.keys():
            own, other = folder_of(name), folder_of(target)
            if own and other:
                assert FLOORS.index(other) <= FLOORS.index(own), f"{name} imports {target}, which lies above it"


def test_every_folder_has_a_floor_and_at_most_fourteen_modules():
    folders = {folder_of(name) for name in MODULES} - {""}
    assert folders == set(FLOORS)
    for folder in folders:
        inside = [name for name in MODULES if folder_of(name) == folder and not is_package(name)]
        assert len(inside) <= MOST_MODULES, folder


def test_tests_lie_where_their_sources_lie():
    # what is compiled is tested with what calls it, parts of the ledger with the ledger
    folders = {name.replace(".", "/") for name in FLOORS}
    tested = {str(path.parent.relative_to(TREE / "tests")) for path in (TREE / "tests").rglob("test_*.py")}
    assert tested - folders == {"front", "house", "properties"}
    inside = {name for name in folders if set(name.split("/")) & {*COMPILED, "ledger"} - {name}}
    assert folders - tested - inside == set(ROOMS)


def test_no_file_has_the_name_of_a_function_or_class_in_it():
    # a name imported from the file would take the file's place in its package
    for name, tree in TREES.items():
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        assert name.rpartition(".")[2] not in own, name


def test_inner_folders_begin_with_their_docstring_and_nothing_else():
    for name, tree in TREES.items():
        if is_package(name) and name.count("."):
            (docstring,) = tree.body
            assert isinstance(docstring, ast.Expr), name


def test_numba_stands_in_the_compiled_folders_only():
    for name, tree in TREES.items():
        if any(isinstance(node, ast.ImportFrom) and node.module == "numba" for node in tree.body):
            assert set(name.split(".")) & set(COMPILED) or name == "core.compilation", name


def literal_columns(function: ast.AST) -> Iterator[str]:
    """The subscripts with a literal column, `t[k, 10]`, `row[7]`, `row[n - 6]`; of shapes and constants they may."""
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript):
            base, place, least = ast.unparse(node.value), node.slice, 2
            if isinstance(place, ast.Tuple):
                place, least = place.elts[-1], 0
            elif isinstance(place, ast.BinOp) and isinstance(place.op, ast.Sub):
                place = place.right
            is_literal = isinstance(place, ast.Constant) and isinstance(place.value, int) and place.value >= least
            if is_literal and not base.endswith(".shape") and not base.strip("_").isupper():
                yield ast.unparse(node)


def test_no_compiled_function_has_a_literal_column():
    found, compiled = [], 0
    for name, tree in TREES.items():
        for node in ast.walk(tree) if set(name.split(".")) & set(COMPILED) else ():
            decorators = [ast.unparse(one) for one in getattr(node, "decorator_list", [])]
            # what writes code of LLVM takes apart the arguments of its function
            if decorators and not re.search("intrinsic|lower_builtin", " ".join(decorators)):
                compiled += 1
                found += [f"{name}: {text}" for text in literal_columns(node)]
    assert compiled > 100 and found == []
    seen = ast.parse("table[n, 3] + row[2] + row[n - 6] + pair[1] + table.shape[2] + TABLE[5] + x[i + 1]")
    assert sorted(literal_columns(seen)) == ["row[2]", "row[n - 6]", "table[n, 3]"]


def test_contributing_lists_the_folders_from_the_ground_up():
    block = re.search(r"^## Where things are$.*?^```text$(.*?)^```$", CONTRIBUTING, re.DOTALL | re.MULTILINE)
    assert block is not None
    listed: list[str] = []
    prefix = ""
    for line in block[1].strip().splitlines():
        names = line.split()
        if not line.startswith(" "):
            # a long list goes on below
            prefix = names.pop(0).removeprefix("src/asperity")
        listed += [f"{prefix}.{name}".removeprefix(".") for name in names]
    of_a_room = [name for name in FLOORS if name.split(".")[0] in ROOMS and name.count(".") == 1]
    of_the_house = [name for name in FLOORS if name not in ROOMS and "." not in name]
    assert listed == [f for f in FLOORS if f in (*of_a_room, *of_the_house)]


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/theory/add-a-primitive.md"])
def test_every_file_that_a_page_for_developers_names_exists(page):
    text = (TREE / page).read_text(encoding="utf-8")
    named = re.findall(r"`((?:src|tests|docs|campaigns|constraints|geometry|kernels|spectral)/[\w./-]*)`", text)
    assert len(named) > 10 and [name for name in named if not (TREE / name).exists()] == []


@pytest.mark.parametrize("room", [geometry, kernels, spectral], ids=ROOMS)
def test_no_folder_hides_a_public_name(room):
    folders = {path.stem for path in (ROOT / room.__name__.rpartition(".")[2]).iterdir()}
    assert folders & set(room.__all__) == set()
