"""Workers compute what this process would: with functions, classes and modules as they are in memory, or not at all."""

import importlib
import os
import pickle
import threading
from dataclasses import dataclass

import pytest

from asperity import Estimate, InputError
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import workers

pytestmark = pytest.mark.skipif(os.name != "posix", reason="processes are ended differently here")

GRID = {"diffuse_fraction": [0.25, 0.5]}
# Each module reads the angle that the first one holds, the last two through a package, one of them imported late.
MODULES = {
    "own_settings.py": "angle = 0.5\n",
    "own_family.py": (
        "import own_settings\nfrom asperity import Estimate, kernels as ker\n"
        "def quantity(law): return Estimate(own_settings.angle, 0.0, 'bound', 'given')\n"
        "def law(rng): return ker.maxwell(own_settings.angle)\n"
        "def swapped(theta): return own_settings.sign * (theta - 1.5707963267948966) + 1.5707963267948966\n"
        "class Given(ker.Law):\n    reversible = True\n"
        "    def _sample(self, theta, rng): return ker.maxwell(own_settings.angle).sample(theta, rng)\n"
        "    def _conditionals(self, *wanted): return ker.maxwell(own_settings.angle).conditionals(*wanted)\n"
    ),
    "own_package/__init__.py": "from . import inner\n",
    "own_package/inner.py": "import own_settings\ndef read(): return own_settings.angle\n",
    "own_nested.py": (
        "import own_package\nfrom asperity import Estimate\n"
        "def quantity(law): return Estimate(own_package.inner.read(), 0.0, 'bound', 'given')\n"
        "def late(law):\n    import own_settings\n    return Estimate(own_settings.angle, 0.0, 'bound', 'given')\n"
    ),
}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The modules, with another angle and sign in memory than on the disk."""
    folder = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch:
        for name, text in MODULES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
        patch.syspath_prepend(str(folder))
        # workers find the modules on the disk too
        patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))
        settings, family, nested = map(importlib.import_module, ("own_settings", "own_family", "own_nested"))
        settings.angle, settings.sign = 0.75, -1.0
        yield family, nested


def test_a_sweep_uses_modules_as_they_are_in_memory(own, tmp_path, worker_processes):
    for module in own:
        path = tmp_path / module.__name__
        found = [
            [row.value for row in spec.sweep(ker.maxwell, GRID, module.quantity, checkpoint=path, client=client).rows]
            for client in (worker_processes, None)
        ]
        assert found == [[0.75, 0.75]] * 2


def test_mean_laws_laws_and_maps_use_modules_as_they_are_in_memory(own, worker_processes):
    family, _ = own
    sampled = {"samples": 2**10, "rng": 1, "method": "monte-carlo"}
    for call in (
        lambda client: spec.mean_law(family.law, 4, ker.Bins(2), client=client),
        lambda client: ker.discretise(family.Given(), ker.Bins(4), client=client, **sampled),
        lambda client: ker.discretise(ker.InvolutionLaw(family.swapped), ker.Bins(4), client=client, **sampled),
    ):
        alone, together = (call(client).array.tolist() for client in (None, worker_processes))
        assert alone == together


def test_what_arrives_with_another_content_is_refused_and_the_advice_works(worker_processes):
    class Forgetful:
        """It pickles without its number."""

        number = 0.5

        def __getstate__(self):
            return {}

        def __call__(self, law):
            return Estimate(self.number, 0.0, "bound", "given")

    told = Forgetful()
    told.number = 0.75
    with pytest.raises(InputError, match=r"arrives there with another content\. .*, or compute without client"):
        spec.sweep(ker.maxwell, GRID, told, client=worker_processes)
    assert [row.value for row in spec.sweep(ker.maxwell, GRID, told).rows] == [0.75, 0.75]


def test_a_module_that_a_worker_would_read_from_the_disk_is_refused_and_the_advice_works(own, worker_processes):
    _, nested = own
    with pytest.raises(InputError, match=r"imports its module inside of itself .*; import at the top of the module"):
        spec.sweep(ker.maxwell, GRID, nested.late, client=worker_processes)
    assert spec.sweep(ker.maxwell, GRID, nested.quantity, client=worker_processes).rows[0].value == 0.75


def test_what_cannot_be_sent_is_refused_and_the_advice_works(worker_processes):
    lock = threading.Lock()

    def locked(law):
        with lock:
            return spec.spectral_gap(law)

    with pytest.raises(InputError, match=r"cannot be sent to workers .*lock.*; keep open files, locks"):
        spec.sweep(ker.maxwell, GRID, locked, client=worker_processes)
    free = spec.sweep(ker.maxwell, GRID, lambda law: spec.spectral_gap(law), client=worker_processes)
    assert [row.value for row in free.rows] == [row.value for row in spec.sweep(ker.maxwell, GRID, locked).rows]


def test_modules_are_sent_by_value_only_while_something_is_packed(own):
    import cloudpickle

    before = cloudpickle.list_registry_pickle_by_value()
    workers.by_value(own[0].quantity)
    assert cloudpickle.list_registry_pickle_by_value() == before


def test_classes_can_be_derived_from_one_that_has_travelled():
    @dataclass(frozen=True)
    class Own:
        part: bool | None = None

    assert pickle.loads(workers.by_value(Own)) is Own

    @dataclass(frozen=True)
    class Derived(Own):
        other: float = 0.0

    # a copy of dataclasses.MISSING in the fields of Own would be the default
    assert Derived().part is None
