"""Computations that differ in memory: a checkpoint of the one must not be taken for that of the other.

A case holds a number in one of many ways (a global, a slot, the default of a dataclass, a ring of objects, ...), and a
quantity of a sweep, or a family of an ensemble, reaches it in another of many ways. The quantity is computed with a
checkpoint; then what holds the number is made again with another one, and the same call must give the new number, or
say that the file is of something else. It may also say at once that the quantity cannot be told; then a key must help.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from campaigns.engine import Campaign, Judged

OLD, NEW = 0.25, 0.5
# How a module holds a number, and the expression that reads it there.
HOLDERS = {
    "global": ("X = {}", "X"),
    "dict": ("X = {{'a': [{}]}}", "X['a'][0]"),
    "class": ("class C:\n    x = {}", "C.x"),
    "dunder of a class": ("class C:\n    __x__ = {}", "C().__x__"),
    "private of a class": ("class C:\n    __x = {}\n    def read(self): return self.__x", "C().read()"),
    "object": ("class C: pass\nX = C()\nX.x = {}", "X.x"),
    "slots": ("class C:\n    __slots__ = ('x',)\nX = C()\nX.x = {}", "X.x"),
    "dropped by __getstate__": ("class C:\n    def __getstate__(self): return {{}}\nX = C()\nX.x = {}", "X.x"),
    "dropped by __reduce__": ("class C:\n    def __reduce__(self): return C, ()\nX = C()\nX.x = {}", "X.x"),
    "slot dropped": (
        "class C:\n    __slots__ = ('x',)\n    def __reduce__(self): return C, ()\nX = C()\nX.x = {}", "X.x"),
    "attribute of an array": (
        "import numpy as np\nclass A(np.ndarray): pass\nX = np.zeros(2).view(A)\nX.x = {}", "X.x"),
    "attribute of a list": ("class L(list): pass\nX = L()\nX.x = {}", "X.x"),
    "default": ("def f(x={}): return x", "f()"),
    "keyword": ("def f(*, x={}): return x", "f()"),
    "closure": ("def made(x):\n    return lambda: x\nf = made({})", "f()"),
    "attribute of a function": ("def f(): return f.x\nf.x = {}", "f()"),
    "constant": ("def f(): return {}", "f()"),
    "property": ("class C:\n    @property\n    def x(self): return {}", "C().x"),
    "class method": ("class C:\n    @classmethod\n    def x(cls): return {}", "C.x()"),
    "static method": ("class C:\n    @staticmethod\n    def x(): return {}", "C.x()"),
    "call": ("class C:\n    def __call__(self): return {}", "C()()"),
    "descriptor": (
        "class D:\n    def __init__(self, x): self.x = x\n    def __get__(self, *_): return self.x\n"
        "class C:\n    x = D({})", "C().x"),
    "metaclass": ("class M(type):\n    x = {}\nclass C(metaclass=M): pass", "C.x"),
    "base class": ("class B:\n    x = {}\nclass C(B): pass", "C.x"),
    "dataclass": ("from dataclasses import dataclass\n@dataclass\nclass C:\n    x: float = {}", "C().x"),
    "factory of a dataclass": (
        "from dataclasses import dataclass, field\n@dataclass\nclass C:\n"
        "    x: list = field(default_factory=lambda: [{}])", "C().x[0]"),
    "enum": ("from enum import Enum\nclass E(Enum):\n    A = {}", "E.A.value"),
    "named tuple": (
        "from typing import NamedTuple\nclass T(NamedTuple):\n    x: float = 0.\nX = T({})", "X.x"),
    "partial": ("from functools import partial\nf = partial(lambda x: x, {})", "f()"),
    "cached": ("from functools import lru_cache\n@lru_cache\ndef f(): return {}", "f()"),
    "cached property": (
        "from functools import cached_property\nclass C:\n    @cached_property\n    def x(self): return {}\nX = C()",
        "X.x"),
    "wrapped": (
        "from functools import wraps\ndef plain(): return 0.\n@wraps(plain)\ndef f(): return {}", "f()"),
    "dispatched": (
        "from functools import singledispatch\n@singledispatch\ndef f(a): return 0.\n"
        "@f.register(int)\ndef _(a): return {}", "f(1)"),
    "deque": ("from collections import deque\nX = deque([{}])", "X[0]"),
    "default dict": ("from collections import defaultdict\nX = defaultdict(lambda: {})", "X.default_factory()"),
    "name space": ("from types import SimpleNamespace\nX = SimpleNamespace(x={})", "X.x"),
    "array": ("import numpy as np\nX = np.array([{}])", "float(X[0])"),
    "array of objects": ("import numpy as np\nX = np.array([[{}], None], dtype=object)", "X[0][0]"),
    "record": ("import numpy as np\nX = np.array([(1, {})], dtype=[('a', int), ('x', float)])", "float(X['x'][0])"),
    "view": ("import numpy as np\nX = np.array([0., {}])[1:]", "float(X[0])"),
    "ring of lists": ("X = [[], []]\nX[0] += [X[1], {}]\nX[1] += [X[0], 0.]", "X[0][0][0][1]"),
    "ring from the other side": ("X = [[], []]\nX[0] += [X[1], {}]\nX[1] += [X[0], 0.]\nX = X[1]", "X[0][1]"),
    "ring of objects": (
        "class C: pass\nA, B, D = C(), C(), C()\nA.next, B.next, D.next = B, D, A\nA.x, B.x, D.x = 0., 0., {}",
        "A.next.next.x"),
    "which of a ring": (
        "X = [[], [], []]\nfor k in range(3): X[k] += [X[(k + 1) % 3], .25 * (k + 1)]\nX = X[int(4 * {}) - 1]",
        "X[1]"),
    "ring in the length": (
        "X = [[] for k in range(int(8 * {}))]\nfor k, one in enumerate(X): one.append(X[(k + 1) % len(X)])\nX = X[0]\n"
        "def length(x):\n    found, at = 1, x[0]\n    while at is not x:\n        found, at = found + 1, at[0]\n"
        "    return found", "length(X) / 8."),
    "mutual functions": (
        "def even(n): return {} if n == 0 else odd(n - 1)\ndef odd(n): return 0. if n == 0 else even(n - 1)",
        "even(4)"),
    "late method": ("class C: pass\nC.x = lambda self: {}", "C().x()"),
    "attribute of a module": ("import types\nX = types.ModuleType('inner')\nX.x = {}", "X.x"),
    "list of modules": ("import types\nX = [types.ModuleType('inner')]\nX[0].x = {}", "X[0].x"),
    "attribute on demand": ("def __getattr__(name): return {} if name == 'late' else 0.", "__getattr__('late')"),
    "bytes": ("X = bytes([int(100 * {})])", "X[0] / 100"),
    "text": ("X = '{}'", "float(X)"),
    "complex": ("X = 1 + {}j", "X.imag"),
    "generator of random numbers": (
        "import numpy as np\nimport copy\nX = np.random.default_rng(int(100 * {}))", "copy.deepcopy(X).random()"),
    "set": ("X = frozenset([{}, 7.])", "min(X)"),
}  # fmt: skip
# How another module reaches what the first one, {m}, reads; lines before the function, lines in it, and the value.
REACHES = {
    "attribute": ("import {m}", "", "{m}.read()"),
    "from": ("from {m} import read", "", "read()"),
    "alias": ("import {m} as own\nother = own", "", "other.read()"),
    "local import": ("", "import {m}", "{m}.read()"),
    "local alias": ("", "import {m} as own", "own.read()"),
    "local from": ("", "from {m} import read as r", "r()"),
    "passed to a helper": ("import {m}\ndef helper(module): return module.read()", "", "helper({m})"),
    "local, passed to a helper": ("def helper(module): return module.read()", "import {m}", "helper({m})"),
    "two helpers": ("import {m}\ndef a(x): return x.read()\ndef b(x): return a(x)", "", "b({m})"),
    "variable": ("import {m}", "own = {m}", "own.read()"),
    "getattr": ("import {m}", "", "getattr({m}, 're' + 'ad')()"),
    "vars": ("import {m}", "", "vars({m})['read']()"),
    "__dict__": ("import {m}", "", "{m}.__dict__['read']()"),
    "globals": ("import {m}", "", "globals()['{m}'].read()"),
    "eval": ("import {m}", "", "eval('{m}.read()')"),
    "exec": ("import {m}", "found = {{}}\n    exec('import {m}; x = {m}.read()', found)", "found['x']"),
    "__import__": ("", "", "__import__('{m}').read()"),
    "importlib": ("import importlib", "", "importlib.import_module('{m}').read()"),
    "import_module": ("from importlib import import_module", "", "import_module('{m}').read()"),
    "sys.modules": ("import sys\nimport {m}", "", "sys.modules['{m}'].read()"),
    "modules of sys": ("from sys import modules\nimport {m}", "", "modules['{m}'].read()"),
    "local sys": ("import {m}", "import sys", "sys.modules['{m}'].read()"),
    "getattr of sys": ("import sys\nimport {m}", "", "getattr(sys, 'modules')['{m}'].read()"),
    "globals of a function": ("from {m} import read as r", "", "r.__globals__['read']()"),
    "frame": ("import sys\nfrom {m} import read", "", "sys._getframe().f_globals['read']()"),
    "attrgetter": ("import {m}\nfrom operator import attrgetter", "", "attrgetter('read')({m})()"),
    "methodcaller": ("import {m}\nfrom operator import methodcaller", "", "methodcaller('read')({m})"),
    "partial": ("import {m}\nfrom functools import partial\nf = partial(getattr, {m})", "", "f('read')()"),
    "list of modules": ("import {m}\nfound = [{m}]", "", "found[0].read()"),
    "table of functions": ("import {m}\nfound = {{'a': {m}.read}}", "", "found['a']()"),
    "object that holds the module": (
        "import {m}\nclass H: pass\nheld = H()\nheld.module = {m}", "", "held.module.read()"),
    "class that holds the module": ("import {m}\nclass H:\n    module = {m}", "", "H.module.read()"),
    "closure": ("import {m}\ndef made(module):\n    return lambda: module.read()\nf = made({m})", "", "f()"),
    "closure, passed on": (
        "import {m}\ndef made(module):\n    return lambda: getattr(module, 'read')()\nf = made({m})", "", "f()"),
    "default": ("import {m}\ndef f(module={m}): return module.read()", "", "f()"),
    "comprehension": ("import {m}", "", "[one.read() for one in [{m}]][0]"),
    "inner function": ("import {m}", "def inner():\n        return {m}.read()", "inner()"),
    "inner class": ("import {m}", "class I:\n        x = {m}.read()", "I.x"),
    "local import in an inner function": ("", "import {m}\n    def inner():\n        return {m}.read()", "inner()"),
    "decorator": (
        "import {m}\ndef given(f):\n    return lambda: f({m})\n@given\ndef f(module): return module.read()", "", "f()"),
    "method": ("import {m}\nclass C:\n    def x(self): return {m}.read()", "", "C().x()"),
    "two modules": ("import {m}", "one, other = {m}, {m}", "other.read()"),
}  # fmt: skip
names = count()


def draw(number: int) -> tuple[str, str, bool]:
    """Every way to hold a number with `attribute`, every way to reach it with `global`; then pairs at random."""
    holders, reaches = list(HOLDERS), list(REACHES)
    if number < len(holders):
        return holders[number], "attribute", False
    if number < len(holders) + len(reaches):
        return "global", reaches[number - len(holders)], False
    rng = np.random.default_rng([1, number])
    return str(rng.choice(holders)), str(rng.choice(reaches)), bool(rng.random() < 0.5)


def judge(case: tuple[str, str, bool]) -> Iterator[Judged]:
    """Whether the second number is found, or the checkpoint refused."""
    holder, reach, of_ensemble = case
    with TemporaryDirectory() as folder, _on_the_path(folder):
        module, user, text = _written(Path(folder), holder, reach)
        computed = _ensemble if of_ensemble else _sweep
        fault, outcome = "", "told apart"
        try:
            first = computed(user, Path(folder) / "a")
            if computed(user, Path(folder) / "a") != first:
                fault = "the same again gives another number"
        except InputError as reason:
            outcome = "refused, with a key instead"
            if 'key="..."' not in str(reason) or computed(user, Path(folder) / "b", key="mine") is None:
                fault = str(reason)
        else:
            exec(text.format(NEW), vars(module))
            with contextlib.suppress(InputError):
                if computed(user, Path(folder) / "a") == first:
                    fault = f"taken for the other: {first}"
        yield Judged("ensemble" if of_ensemble else "sweep", fault=f"{holder}, {reach}: {fault}" if fault else "",
                     outcome=outcome)  # fmt: skip


@contextlib.contextmanager
def _on_the_path(folder: str) -> Iterator[None]:
    before = dict(sys.modules)
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        for name in set(sys.modules) - set(before):
            if name.startswith(("held_", "user_")):
                del sys.modules[name]


def _written(folder: Path, holder: str, reach: str) -> tuple[ModuleType, ModuleType, str]:
    """The module that holds the number, the one that reaches it, and the text of the first."""
    number = next(names)
    name = f"held_{number}"
    kept, expression = HOLDERS[holder]
    text = f"{kept}\n\ndef read():\n    return {expression}\n"
    (folder / f"{name}.py").write_text(text.format(OLD))
    before, inside, value = (one.format(m=name) for one in REACHES[reach])
    (folder / f"user_{number}.py").write_text(
        f"from asperity.estimates import Estimate\nfrom asperity import kernels as ker\n{before}\n\n"
        f"def value():\n    {inside}\n    return {value}\n\n"
        "def quantity(law):\n    return Estimate(float(value()), 0.0, 'bound', 'given')\n\n"
        "def family(rng):\n    return ker.maxwell(float(value()))\n"
    )
    importlib.invalidate_caches()
    return importlib.import_module(name), importlib.import_module(f"user_{number}"), text


def _sweep(user: Any, path: Path, key: str | None = None) -> float | None:
    table = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.5]}, user.quantity, checkpoint=path, key=key)
    return table.rows[0].value


def _ensemble(user: Any, path: Path, key: str | None = None) -> list[float]:
    mean = spec.mean_law(user.family, 4, ker.Bins(2), checkpoint=path, key=key)
    found: list[float] = mean.array.ravel().tolist()
    return found


CAMPAIGNS = (
    Campaign(
        "ways-of-differing", "Is the checkpoint of one computation ever taken for another?", draw, judge, 600,
        (*range(0, 60, 7), *range(60, 110, 9)), seconds=60.0,
    ),
)  # fmt: skip
