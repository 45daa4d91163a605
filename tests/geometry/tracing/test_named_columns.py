"""Compiled functions name the columns of tables: read from the syntax trees of the sources."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

import asperity

PACKAGE = Path(asperity.__file__).parent
NUMBA = {"njit", "jit", "vectorize", "guvectorize"}


def names_in(node):
    nodes = (inner for inner in ast.walk(node) if isinstance(inner, ast.Name | ast.Attribute))
    return {inner.id if isinstance(inner, ast.Name) else inner.attr for inner in nodes}


def sources():
    """Every module of the package with the decorators that compile: numba's, and names bound to calls of them."""
    trees = {path: ast.parse(path.read_text()) for room in ("geometry", "kernels", "spectral", "core")
             for path in sorted((PACKAGE / room).resolve().rglob("*.py"))}  # fmt: skip
    bound = (node for tree in trees.values() for node in tree.body if isinstance(node, ast.Assign))
    compilers = NUMBA.union(*(names_in(node.targets[0]) for node in bound if NUMBA & names_in(node.value)))
    return trees, compilers


def number(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, int) else -1


def literal_columns(function):
    """The subscripts with a literal column: ``t[k, 10]``, ``row[7]``, ``row[n - 6]``.

    Shapes, constants in capitals, neighbours as ``x[i + 1]`` and pairs, of which a function uses 0 and 1 alone, are
    none.
    """
    found, single = [], defaultdict(list)
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript):
            base, index = ast.unparse(node.value), node.slice
            if base.endswith(".shape") or base.strip("_").isupper():
                continue
            if isinstance(index, ast.Tuple):
                found += [ast.unparse(node)] * (number(index.elts[-1]) >= 0)
            elif isinstance(index, ast.BinOp):
                found += [ast.unparse(node)] * (isinstance(index.op, ast.Sub) and number(index.right) > 1)
            elif number(index) >= 0:
                single[base].append((number(index), ast.unparse(node)))
    return found + [text for uses in single.values() if max(uses)[0] > 1 for _, text in uses]


def test_no_compiled_function_has_a_literal_column():
    trees, compilers = sources()
    compiled, found = 0, []
    for path, tree in trees.items():
        for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            if any(compilers & names_in(decorator) for decorator in function.decorator_list):
                compiled += 1
                found += [f"{path.name}:{function.name}: {text}" for text in literal_columns(function)]
    assert compiled > 100
    assert found == []


def test_a_literal_column_is_seen():
    [function] = ast.parse("def f(table, row, pair, n):\n    return table[n, 3] + row[2] + row[n - 6] + pair[1]").body
    assert sorted(literal_columns(function)) == ["row[2]", "row[n - 6]", "table[n, 3]"]


def test_the_page_on_primitives_names_files_that_exist():
    root = Path(__file__).resolve().parents[3]
    page = root / "docs" / "theory" / "add-a-primitive.md"
    if not page.exists():
        pytest.skip("no documentation beside the tests")
    named = re.findall(r"`((?:geometry|tests)/[\w./-]*)`", page.read_text(encoding="utf-8"))
    assert len(named) > 15
    assert [name for name in named if not (root / name).exists()] == []
    assert "theory/add-a-primitive" in (root / "docs" / "index.md").read_text(encoding="utf-8")
    assert "docs/theory/add-a-primitive.md" in (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
