import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hippodrome.proto.arrays import FieldError, pack, unpack

DTYPES = ("int8", "uint8", "int32", "float32", "float64")


@given(st.sampled_from(DTYPES).flatmap(lambda name: hnp.arrays(np.dtype(name), hnp.array_shapes(max_dims=4, min_side=0))))
def test_round_trip_is_bytewise_exact_for_any_value(array):
    back = unpack(pack(array, array.dtype.name, array.shape, "x"), array.dtype.name, array.shape, "x")
    assert (back.dtype, back.shape, back.tobytes()) == (array.dtype, array.shape, array.tobytes())


def test_bytes_are_planes_of_little_endian_bytes():
    assert pack(np.array([0x04030201, 0x14131211], np.int32), "int32", (2,), "x").hex() == "0111021203130414"


def test_strided_input_is_packed_by_value():
    array = np.arange(12, dtype=np.float64).reshape(3, 4)
    assert pack(array.T, "float64", (4, 3), "x") == pack(array.T.copy(), "float64", (4, 3), "x")


@pytest.mark.parametrize("array", [np.zeros(3, np.float32), np.zeros(2), np.zeros((3, 1))])
def test_wrong_type_or_shape_is_not_converted(array):
    with pytest.raises(FieldError, match=r"poses is .*, a map holds float64 \(3,\)"):
        pack(array, "float64", (3,), "poses")


def test_declared_size_is_checked_before_allocation():
    with pytest.raises(FieldError, match="needs"):
        unpack(b"12345678", "float64", (1 << 62, 1 << 62), "poses")


def test_loaded_arrays_are_writable_and_own_their_memory():
    back = unpack(pack(np.ones(3), "float64", (3,), "x"), "float64", (3,), "x")
    back[0] = 2.0
    assert back.tolist() == [2.0, 1.0, 1.0]
