"""Ibrahimbegovic, A. (1997), On the choice of finite rotation parameters, Comput. Methods Appl. Mech. Eng. 149: a cantilever wound to a
helix, beside a shooting solution."""

import math
from itertools import pairwise

import numpy as np
import pytest
from pipe_helpers import bar, rotation, rotation_vector_quaternion, times
from rods import at_tip, cantilever, clamped, order

FORWARD = (1.0, 0.0, 0.0, 0.0)


def rolled(s, bends):
    """Positions and attitudes of an unstretched line from the rotation vectors (n - 1, 3) of its elements."""
    position, attitude = [np.zeros(3)], [np.array(FORWARD)]
    for h, bend in zip(np.diff(s), bends, strict=True):
        middle = rotation(times(attitude[-1], rotation_vector_quaternion(0.5 * bend)))
        position.append(position[-1] + h * np.sinc(0.5 * np.linalg.norm(bend) / math.pi) * middle[:, 0])
        attitude.append(times(attitude[-1], rotation_vector_quaternion(bend)))
    return np.array(position), np.array(attitude)


def bends_of(attitude):
    """Rotation vectors (n - 1, 3) of the elements."""
    turns = np.array([times(a * [1, -1, -1, -1], b) for a, b in pairwise(attitude)])
    size = np.linalg.norm(turns[:, 1:], axis=1, keepdims=True)
    return 2.0 * np.arctan2(size, turns[:, :1]) * turns[:, 1:] / size


def helix(elements, part):
    """Equilibrium of Ibrahimbegovic's cantilever at a part of its loads: wound flat by the moment, then the force in eight steps."""
    length, moment, force = 10.0, 200.0 * math.pi * part, 50.0 * part
    s, line = bar(length, elements + 1, axial=1e4, shear=1e4, torsion=1e2, bending=1e2)
    at = rolled(s, np.tile([0.0, moment / 1e2 * length / elements, 0.0], (elements, 1)))
    for share in np.linspace(0.125, 1.0, 8):
        at = clamped(line, *at, at_tip(elements + 1, (0.0, share * force, 0.0), (0.0, moment, 0.0)))
    return at, cantilever(length, [1e4] * 3 + [1e2] * 3, at[1][-1], (0.0, force, 0.0), (0.0, moment, 0.0))[0]


def test_ibrahimbegovic_cantilever_wound_to_a_helix_of_ten_turns():
    """Ibrahimbegovic (1997): L = 10, EI = GJ = 1e2, EA = GA = 1e4, tip moment 200 pi and tip force 50 across the plane of winding.

    Published, with 100 elements: the tip swings to and fro across the plane, once a turn, ever less, and ends beside it after ten turns.
    Shooting gives 0.5207, 0.3042, -0.2266 and -0.0764 at 0.25, 0.45, 0.5 and 1 of the loads; ours -0.0759 at full load with 100 elements.
    """
    swing = []
    for part, elements in ((0.25, 50), (0.45, 50), (0.5, 50)):
        at, exact = helix(elements, part)
        np.testing.assert_allclose(at[0][-1], exact, atol=0.03)
        swing.append(exact[1])
    coarse, exact = helix(50, 1.0)
    fine, exact = helix(100, 1.0)
    np.testing.assert_allclose([*swing, exact[1]], [0.5207, 0.3042, -0.2266, -0.0764], atol=1e-4)
    np.testing.assert_allclose(fine[0][-1], exact, atol=6e-4)
    assert order(coarse[0][-1], fine[0][-1], exact) > 3.8
    assert np.linalg.norm(bends_of(fine[1]), axis=1).sum() == pytest.approx(20.0 * math.pi, rel=3e-4)
