"""Lanes against numpy: arithmetic, reductions, single lanes, and reading and writing of arrays, each in a small kernel of its own."""

import math

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from pipe_helpers import bar, loaded

from pipe_fmu.line import line_columns
from pipe_fmu.loads import Bed
from pipe_fmu.simd.columns import fill_straight, room
from pipe_fmu.simd.lane_arrays import grid, group, lane, row, rows_of_six, six
from pipe_fmu.simd.lanes import WIDTH, above, below, lane_by_lane, largest, total

inner = njit(error_model="numpy")  # as the package's own, but never taken from a cache
A = np.array([1.5, -2.0, 0.25, -0.5, 3.0, -4.5, 0.125, -8.0])
B = np.array([-0.5, 4.0, 2.0, -3.0, 3.0, 1.0, -7.0, -0.25])


@inner
def arithmetic(a, b, out):
    x, y = a[group(0)], b[group(0)]
    out[0, group(0)] = x + 2.0 * y
    out[1, group(0)] = x - y
    out[2, group(0)] = x / y
    out[3, group(0)] = -x
    out[4, group(0)] = math.sqrt(math.fabs(x))
    out[5, group(0)] = math.copysign(x, y)
    out[6, group(0)] = max(x, y)
    out[7, group(0)] = min(x, y)
    out[8, group(0)] = above(x, 0.25)


def test_arithmetic_is_numpys_lane_by_lane():
    out = np.empty((9, WIDTH))
    arithmetic(A, B, out)
    expected = [A + 2 * B, A - B, A / B, -A, np.sqrt(np.abs(A)), np.copysign(A, B), np.maximum(A, B), np.minimum(A, B), A > 0.25]
    np.testing.assert_allclose(out, expected, rtol=1e-15)


@inner
def reduced(a, bound):
    x = a[group(0)]
    return total(x), largest(x), below(x, bound)


@pytest.mark.parametrize("at", range(WIDTH))
def test_every_lane_counts_in_a_reduction_and_one_that_is_no_number_shows(at):
    a = np.zeros(WIDTH)
    a[at] = 2.0
    assert reduced(a, 2.0) == (2.0, 2.0, False)
    assert reduced(a, 2.1) == (2.0, 2.0, True)
    a[at] = math.nan
    assert math.isnan(reduced(a, 1.0)[1])
    assert not reduced(a, 1.0)[2]


@lane_by_lane
@inner
def _parts(x):
    return (x * x, -x) if x > 0.0 else (x, 1.0)


@inner
def one_by_one(a, out):
    out[0, group(0)], out[1, group(0)] = _parts(a[group(0)])


def test_a_function_of_one_number_is_taken_to_every_lane():
    out = np.empty((2, WIDTH))
    one_by_one(A, out)
    np.testing.assert_array_equal(out, [np.where(A > 0, A * A, A), np.where(A > 0, -A, 1.0)])


def test_lanes_of_an_array_that_is_not_contiguous_are_refused():
    with pytest.raises(TypingError):
        reduced(np.arange(2.0 * WIDTH)[::2], 0.0)


@inner
def through_scratch(a, out, numbers):
    cells, line, sixes = grid(2, 3), row(2), rows_of_six(6)
    for i in range(2):
        line[i] = a[i, group(1)]
        for k in range(3):
            cells[i, k] = (10.0 * i + k) * line[i]
    for m in range(WIDTH):
        ours = lane(cells, m)
        ours[1, 2] += 1000.0 * m
        numbers[m] = lane(cells[1], m)[2] + lane(line[0], m)
    for i in range(2):
        for k in range(3):
            out[i, k, group(0)] = cells[i, k]
    for i in range(6):
        sixes[i] = a[0, six(i)]
    for i in range(6):
        out[1, 3, i] = lane(sixes, i)[i]


def test_lanes_go_to_scratch_and_back_and_are_numbers_there():
    a = np.arange(40.0).reshape(2, 20)
    out, numbers = np.full((2, 4, WIDTH), -1.0), np.empty(WIDTH)
    through_scratch(a, out, numbers)
    expected = np.array([[(10.0 * i + k) * a[i, 1 : 1 + WIDTH] for k in range(3)] for i in range(2)])
    expected[1, 2] += 1000.0 * np.arange(WIDTH)
    np.testing.assert_array_equal(out[:, :3], expected)
    np.testing.assert_array_equal(numbers, expected[1, 2] + a[0, 1 : 1 + WIDTH])
    np.testing.assert_array_equal(out[1, 3, :6], a[0, 0:12:2])


def test_columns_have_room_for_the_last_nodes_and_for_the_upper_ends_of_the_last_elements():
    for n in range(2, 60):
        nodes, elements = range(0, n, WIDTH), range(0, n - 1, WIDTH)
        assert room(n) >= max(nodes[-1] + WIDTH, elements[-1] + 1 + WIDTH)


def fields(*lines):
    """(name, values...) of the arrays of lines, those of nested tuples too."""
    for name, *parts in zip(lines[0]._fields, *lines, strict=True):
        if isinstance(parts[0], tuple):
            yield from fields(*parts)
        elif isinstance(parts[0], np.ndarray):
            yield name, *parts


def test_behind_its_end_a_line_goes_on_straight_and_without_what_would_add():
    position, out = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, -1.0], [3.0, 3.0, -1.5]]), np.empty((3, room(3)))
    fill_straight(position, out)
    ahead = np.arange(1, room(3) - 2)[:, None] * [2.0, 1.0, -0.5]
    np.testing.assert_array_equal(out.T, np.vstack([position, position[-1] + ahead]))
    present = {"damping": np.ones(2), "offset": np.ones(3), "added_mass": np.ones((3, 3)), "spin_damping": np.ones((3, 3))}
    line = bar(10.0, 3, axial=1e5, shear=1e5, torsion=80.0, bending=100.0)[1]._replace(**present)
    on_bed = Bed(np.ones(2), np.ones(2), 1.0, 0.5, 1e-3)
    line = loaded(line, weight=np.ones(2), drag=np.ones((2, 2)), bed=on_bed)

    for name, before, there in fields(line, line_columns(line)):
        beyond = there[..., len(before) :]
        assert there.shape[-1] == room(3)
        np.testing.assert_array_equal(there[..., : len(before)], before.T)
        if name in ("length", "share", "diameter"):  # shape, which goes on
            np.testing.assert_array_equal(beyond, np.broadcast_to(before[-1][..., None], beyond.shape))
        else:
            assert not beyond.any()
