"""Records: numbers and arrays that compiled functions find by one address."""

import copy
import pickle
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import typeof

from asperity import geometry as geo
from asperity.core.compilation import jit
from asperity.geometry.scene.compiled.records import RecordType, array_of, place_of
from asperity.geometry.scene.records import Record


class Inside(NamedTuple):
    count: int


class Fields(NamedTuple):
    number: float
    is_true: bool
    inside: Any
    counts: Any
    marks: Any
    table: Any


def fields():
    table = np.arange(6.0).reshape(3, 2)
    return Fields(0.1, True, Record(Inside(-7)), np.array([1, 2**62]), np.array([3, 255], np.uint8), table)


@jit()
def found(record):
    table = record.table
    table[2, 0] = record.number
    record.counts[0] = 5
    row = table[1]
    return (
        record.number, record.is_true, record.inside.count, record.counts[1], record.marks[1], record.marks.shape[0],
        table[2, 1], row[0], table.shape, array_of(table)[:, 1].sum(),
    )  # fmt: skip


def test_compiled_functions_read_every_kind_of_field_and_write_to_arrays():
    values = fields()
    assert found(Record(values)) == (0.1, True, -7, 2**62, 255, 2, 5.0, 2.0, (3, 2), 9.0)
    assert values.table[2, 0] == 0.1 and values.counts[0] == 5


record_at = place_of(Record(fields()))


@jit()
def table_found_from(address):
    record = record_at(address)
    return record.address, record.table[1, 1], record.inside.address


def test_a_record_is_found_at_its_address():
    record = Record(fields())
    assert table_found_from(record.address) == (record.address, 3.0, record.inside.address)


def test_a_trace_passes_no_records_from_python():
    # each would take 4 us, a sixth of the time of a trace of one ray
    from asperity.geometry.tracing.compiled.closed_forms import trace_closed
    from asperity.geometry.tracing.compiled.rays import trace_rays

    geo.trace(geo.mushrooms(0.3), 0.3, 1.0)
    geo.trace(geo.triangular_teeth(0.7), 0.3, 1.0)
    for function in (trace_rays, trace_closed):
        assert function.signatures
        assert not any(isinstance(kind, RecordType) for kinds in function.signatures for kind in kinds)


def test_records_of_one_kind_have_one_type():
    first, second = Record(fields()), Record(fields()._replace(counts=np.zeros(9, np.int64), number=3.0))
    other = Record(fields()._replace(counts=np.zeros(2)))
    assert typeof(first) is typeof(second) and typeof(first) is not typeof(other)
    found(first)
    found(second)
    assert len(found.overloads) == 1


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda record: pickle.loads(pickle.dumps(record))])
def test_a_copy_has_its_own_place_in_memory(copied):
    record = Record(fields())
    twin = copied(record)
    assert twin.address != record.address and twin.inside.address != record.inside.address
    found(twin)
    assert record.table[2, 0] == 4.0 and twin.table[2, 0] == 0.1


def test_a_wall_that_was_traced_can_be_sent_to_another_process():
    wall = geo.mushrooms(0.3)
    ray = geo.trace(wall, 0.3, 1.0)
    twin = pickle.loads(pickle.dumps(wall))
    assert geo.trace(twin, 0.3, 1.0).x == ray.x


def test_an_array_with_gaps_is_refused():
    with pytest.raises(ValueError, match="contiguous"):
        Record(fields()._replace(table=np.zeros((3, 4))[:, ::2]))
