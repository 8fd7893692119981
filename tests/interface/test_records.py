"""Records: what is read is bitwise what was written, and nothing but data can be."""

import json
from collections import OrderedDict
from dataclasses import dataclass
from enum import Enum, Flag

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays, scalar_dtypes
from scipy.sparse import csr_array

from interface import SurfaceMesh, Variable, records


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True, eq=False)
class Shape:
    x: np.ndarray
    before: "Shape | None" = None
    colour: Colour = Colour.RED


NUMBERS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
ARRAYS = arrays(scalar_dtypes(), array_shapes(min_dims=0, min_side=0))
VALUES = st.recursive(
    NUMBERS,
    lambda inner: st.lists(inner) | st.lists(inner).map(tuple) | st.dictionaries(st.text() | st.integers(), inner),
)


@given(VALUES)
def test_plain_values_come_back_equal_and_of_their_types(value):
    assert repr(records.loads(records.dumps(value))) == repr(value)


@given(ARRAYS)
def test_arrays_come_back_bitwise(array):
    back = records.loads(records.dumps([array]))[0]
    assert (back.dtype.newbyteorder("="), back.shape) == (array.dtype.newbyteorder("="), array.shape)
    assert back.tobytes() == array.tobytes()


def test_arrays_keep_their_order_in_memory_since_sums_depend_on_it():
    c = np.arange(12.0).reshape(3, 4)
    for array in (c, np.asfortranarray(c), c[:, ::2], c.T[1:]):
        back = records.loads(records.dumps(array))
        assert np.array_equal(back, array)
        if array.flags.f_contiguous or array.flags.c_contiguous:
            assert back.strides == array.strides


def test_what_is_not_finite_comes_back():
    back = records.loads(records.dumps((float("nan"), float("-inf"), -0.0, np.array([np.nan, np.inf]))))
    assert np.isnan(back[0])
    assert back[1] == -np.inf
    assert np.signbit(back[2])
    assert np.array_equal(back[3], [np.nan, np.inf], equal_nan=True)


def test_an_array_in_two_places_is_stored_once_and_shared_afterwards():
    x = np.arange(3000.0)
    data = records.dumps({"a": x, "b": (x, 1)})
    back = records.loads(data)
    assert back["a"] is back["b"][0]
    assert len(data) < 1.5 * x.nbytes


def test_dataclasses_enumerations_sets_and_sparse_arrays_come_back():
    value = (
        Shape(np.ones(2), Shape(np.zeros(0)), Colour.RED),
        {"b", "a"},
        frozenset({2, 1}),
        csr_array(np.diag([1.0, 0.0, 3.0])),
        SurfaceMesh(np.zeros((3, 3)), np.array([[0, 1, 2, 2]])),
        Variable("p", (1,), unit="Pa"),
        np.float32(0.1),
    )
    shape, names, numbers, sparse, mesh, variable, small = records.loads(records.dumps(value))
    assert shape.before.colour is Colour.RED
    assert np.array_equal(shape.x, [1.0, 1.0])
    assert (names, numbers) == ({"b", "a"}, frozenset({1, 2}))
    assert np.array_equal(sparse.toarray(), np.diag([1.0, 0.0, 3.0]))
    assert mesh.panels.dtype == value[4].panels.dtype
    assert (variable.name, variable.shape, variable.unit) == ("p", (1,), "Pa")
    assert type(small) is np.float32


def test_the_same_value_gives_the_same_bytes():
    value = {"x": np.linspace(0.0, 1.0, 50), "of": Shape(np.ones(3)), "names": {"c", "a", "b"}}
    data = records.dumps(value)
    assert records.dumps(records.loads(data)) == data


def _local():
    @dataclass
    class Local:
        x: int = 0

    return Local()


def _endless():
    value = []
    value.append(value)
    return value


@dataclass
class Marked:
    x: int = 0

    def __post_init__(self):
        self.cache = {}


@dataclass
class Listed(list):
    x: int = 0


class Bits(Flag):
    A = 1
    B = 2


@pytest.mark.parametrize(
    "value",
    [
        object(), lambda: 0, np.array([{}], dtype=object), np.zeros(1, dtype="f8,i4"), open, range(3), Shape, _local(),
        _endless(), Marked(), Listed(), Bits.A | Bits.B, Bits(0), OrderedDict(), np.random.default_rng(0),
    ],
)  # fmt: skip
def test_what_is_no_data_is_refused_when_it_is_stored(value):
    with pytest.raises(TypeError, match=r"^.* cannot be stored[.;]"):
        records.dumps([value])


def test_numbers_of_every_kind_bytes_and_mixed_sets_come_back():
    value = (1j, complex("nan+infj"), b"\x00\xff", {1, "a", (2, 3)}, Bits.A, 10**30, np.complex128(2j))
    back = records.loads(records.dumps(value))
    assert repr(back[:2]) == repr(value[:2])
    assert back[2:] == value[2:]


def _with_tree(tree):
    return records.npz({"tree": np.frombuffer(json.dumps(tree).encode(), np.uint8)})


@pytest.mark.parametrize(
    "tree",
    [
        {"of": "os:system", "fields": {}},
        {"of": "subprocess:Popen", "fields": {"args": "true"}},
        {"of": "interface.records:_Reader", "fields": {}},
        {"of": "interface.variables:Variable", "fields": {"name": "x"}},
        {"enum": "interface.variables:Variable", "member": "name"},
        {"array": "f8", "at": 0, "shape": [3]},
        {"odd": 1},
    ],
)
def test_a_record_can_make_nothing_but_data(tree):
    with pytest.raises((ValueError, LookupError, TypeError)):
        records.loads(_with_tree(tree))


@pytest.mark.parametrize("data", [b"", b"no zip", records.dumps(1)[:-5], records.npz({"x": np.zeros(1)})])
def test_what_is_no_record_is_refused(data):
    with pytest.raises((ValueError, LookupError)):
        records.loads(data)
