"""What is read-only in an object is read-only in its copies and pickles, and nothing else is."""

import copy
import inspect
import pickle
import re
from collections.abc import Mapping
from functools import partial

import cloudpickle
import numpy as np
import pytest
from campaigns.cases.public_calls import CALLS, OBJECTS

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.contents import content
from asperity.errors import InputError
from conftest import BASES, LAWS, made

RESULTS = ("trace", "limit_study", "accommodation", "wall_for", "study_wall", "work_precision")
THINGS = {f"{type(thing).__name__} {k}": partial(lambda thing: thing, thing) for k, thing in enumerate(OBJECTS)}
THINGS |= LAWS | BASES | {name: partial(CALLS[name][0], **CALLS[name][1]) for name in RESULTS}
WAYS = {f"pickle {protocol}": partial(pickle.dumps, protocol=protocol) for protocol in range(6)}
WAYS = {name: lambda thing, dumps=dumps: pickle.loads(dumps(thing)) for name, dumps in WAYS.items()}
WAYS |= {"copy": copy.copy, "deepcopy": copy.deepcopy, "cloudpickle": lambda one: pickle.loads(cloudpickle.dumps(one))}


def arrays_in(value, path="", depth=4):
    """The arrays that public attributes reach, by their names."""
    if isinstance(value, np.ndarray):
        return {path: value}
    parts = {}
    if isinstance(value, Mapping):
        parts = {f"[{key!r}]": one for key, one in value.items()}
    elif isinstance(value, (tuple, list)):
        parts = {f"[{k}]": one for k, one in enumerate(value)}
    elif depth and type(value).__module__.startswith("asperity") and not isinstance(value, type):
        depth -= 1
        for name in {*dir(type(value)), *getattr(value, "__dict__", ())}:
            if not name.startswith("_") and not callable(inspect.getattr_static(value, name)):
                try:
                    parts[f".{name}"] = getattr(value, name)
                except InputError:
                    continue
    return {name: one for part, each in parts.items() for name, one in arrays_in(each, path + part, depth).items()}


@pytest.mark.parametrize("name", THINGS)
def test_copies_have_the_same_arrays_and_are_read_only_where_the_original_is(name):
    thing = made(THINGS[name])
    for way, copied in WAYS.items():
        try:
            new = copied(thing)
        except (pickle.PicklingError, AttributeError) as reason:
            # functions of the tests, which cloudpickle takes
            assert way.startswith("pickle ") and re.search("<lambda>|bounced_law", str(reason))
            continue
        there = arrays_in(new)
        for path, array in arrays_in(thing).items():
            assert np.array_equal(there[path], array, equal_nan=array.dtype.kind == "f"), (way, path)
            assert array.flags.writeable or not there[path].flags.writeable, (way, path)
        assert content(new) == content(thing), way


class OwnLaw(ker.Law):
    """A law with what the library does not know: slots, writable arrays, lists, and a circle."""

    __slots__ = ("known",)

    def __init__(self, known):
        self.known = np.array([known, 2.0])
        self.known.setflags(write=False)
        self.counts, self.last, self.pairs = np.zeros(2), [self.known], (self.known, (np.zeros(1), "a"))
        self.partner, self.own = {"self": self}, (self,)

    def _sample(self, theta, rng):
        return theta

    def _conditionals(self, theta, tolerance, degree, edges):
        return ker.Conditionals.of_atoms(theta[:, None], np.ones((theta.size, 1)))


@pytest.mark.parametrize("way", [way for way in WAYS if way not in ("pickle 0", "pickle 1")])
def test_a_users_law_is_copied_as_it_is(way):
    law = OwnLaw(1.0)
    new = WAYS[way](law)
    assert type(new) is OwnLaw and new is not law
    assert new.known.tolist() == [1.0, 2.0] and not new.known.flags.writeable and new.counts.flags.writeable
    assert new.pairs[0] is new.known is new.last[0] and new.pairs[1][0].flags.writeable and type(new.last) is list
    assert (new.partner is law.partner and new.own is law.own) if way == "copy" else new.partner["self"] is new
    assert new.sample(1.0) == 1.0 and (way == "copy" or content(new) == content(law))


def test_a_copied_matrix_takes_no_other_entries():
    law = copy.deepcopy(ker.MatrixLaw([[0.5, 0.5], [0.5, 0.5]]))
    with pytest.raises(ValueError, match="read-only"):
        law.array[0, 0] = 5.0
    # nobody else's
    assert law._masses.flags.writeable


def test_the_defaults_of_a_named_wall_are_read_only_in_copies_too():
    named = copy.deepcopy(geo.WALLS["koch"])
    assert named == geo.WALLS["koch"]
    with pytest.raises(TypeError, match="item assignment"):
        named.defaults["generations"] = 5
