"""Timoshenko, S. P., and Gere, J. M. (1961), Theory of elastic stability: lateral buckling of cantilevers, and a cantilever rolled up."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, dense_equilibrium, pitch, static_system, straight, turned
from rods import critical, extrapolated, lowest


@pytest.mark.parametrize("turns", [1, 2])
def test_cantilever_rolled_to_a_circle_by_an_end_moment(turns):
    """Roll-up of a cantilever: M = 2 pi n EI / L bends it to a circle, exactly, with no force anywhere."""
    length, bending, n = 10.0, 1.2e3, 11
    s, line = bar(length, n, axial=1e6, shear=1e6, torsion=1e3, bending=bending)
    kappa = 2 * math.pi * turns / length
    position = np.column_stack([np.sin(kappa * s) / kappa, 0 * s, -(1 - np.cos(kappa * s)) / kappa])
    attitude = np.array([pitch(kappa * x) for x in s])
    load = np.zeros(6 * n)
    load[-2] = bending * kappa
    shaken = turned(position, attitude, np.vstack([np.zeros(6), 1e-3 * np.random.default_rng(0).normal(size=(n - 1, 6))]))
    found = dense_equilibrium(line, *shaken, np.arange(6, 6 * n), load)
    np.testing.assert_allclose(found[0], position, atol=1e-11)
    reaction = static_system(line, *found)[0][:6]
    np.testing.assert_allclose(reaction, [0, 0, 0, 0, -bending * kappa, 0], atol=1e-7)


def test_lateral_buckling_of_a_cantilever_under_a_tip_force():
    """Deep narrow cantilever: P L^2 / sqrt(EI GJ) = 4.0126 (Timoshenko and Gere, Theory of elastic stability, 6.3)."""
    length, bending, torsion = 10.0, 1e3, 8e2
    scale = math.sqrt(bending * torsion) / length**2

    def factor(n):
        s, line = bar(length, n, axial=1e9, shear=1e9, torsion=torsion, bending=1e9, bending_3=bending)

        def value(force):
            load = np.zeros(6 * n)
            load[6 * n - 4] = force * scale
            return lowest(line, *straight(s), load)

        return critical(value, 3.6, 4.4)

    assert extrapolated(factor(9), factor(17)) == pytest.approx(4.0126, rel=5e-4)


def test_lateral_buckling_of_a_cantilever_under_its_weight():
    """q L^3 / sqrt(EI GJ) = 12.85 (Timoshenko and Gere, 6.3): the sag's part of the tangent."""
    length, bending, torsion = 10.0, 1e3, 8e2

    def factor(n):
        def value(weight):
            load = weight * math.sqrt(bending * torsion) / length**3
            s, line = bar(length, n, axial=1e9, shear=1e9, torsion=torsion, bending=1e9, bending_3=bending, weight=load)
            return lowest(line, *straight(s))

        return critical(value, 12.0, 14.0)

    assert extrapolated(factor(9), factor(17)) == pytest.approx(12.85, rel=1e-3)
