"""Blevins, R. D. (1979), Formulas for natural frequency and mode shape: a string, a beam, a bar and a hanging chain."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, dense_equilibrium, straight
from rods import UPRIGHT, matrices
from scipy.linalg import eigh


def frequencies(line, position, attitude, unknowns, count):
    """Lowest circular frequencies [rad/s] with only `unknowns` free."""
    mass, stiffness = (m[np.ix_(unknowns, unknowns)] for m in matrices(line, position, attitude))
    values = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T), eigvals_only=True)
    return np.sqrt(values[:count])


def unknowns(n, kinds, held):
    """Indices of the unknowns `kinds` (0-5) of all nodes but the pairs (node, kind) `held`."""
    return np.array([6 * i + k for i in range(n) for k in kinds if (i, k) not in held])


def test_frequencies_of_a_taut_string():
    """omega_n = k sqrt(T / m), k = n pi / L, pinned ends, with the little bending stiffness: sqrt((T k^2 + EI k^4) / m)."""
    n, length, tension, axial, bending, m = 33, 100.0, 5e4, 1e8, 1e2, 20.0
    s, line = bar(length, n, axial=axial, shear=1e8, torsion=1e3, bending=bending, mass=m, inertia=1e-6)
    stretch = 1 + tension / axial
    position, attitude = straight(s)
    k = np.arange(1, 4) * math.pi / (length * stretch)
    exact = np.sqrt((tension * k**2 + bending * k**4) * stretch / m)
    for across, about in ((2, 4), (1, 5)):
        free = unknowns(n, (across, about), {(0, across), (n - 1, across)})
        got = frequencies(line, position * stretch, attitude, free, 3)
        np.testing.assert_allclose(got, exact, rtol=2e-4)  # fourth order: (k h)^4 / 100


def test_frequencies_of_a_clamped_beam():
    """beta L = 4.7300, 7.8532, 10.9956 (Euler-Bernoulli; shear and rotary inertia negligible here)."""
    n, length, bending, m = 33, 100.0, 1e6, 20.0
    s, line = bar(length, n, axial=1e10, shear=1e10, torsion=1e6, bending=bending, mass=m, inertia=1e-6)
    exact = (np.array([4.730040745, 7.853204624, 10.995607838]) / length) ** 2 * math.sqrt(bending / m)
    got = frequencies(line, *straight(s), unknowns(n, (2, 4), {(0, 2), (0, 4), (n - 1, 2), (n - 1, 4)}), 3)
    np.testing.assert_allclose(got, exact, rtol=1e-4)  # fourth order


def test_frequencies_of_axial_and_torsional_vibration():
    n, length, m, polar = 33, 100.0, 20.0, 5.0
    s, line = bar(length, n, axial=1e8, shear=1e8, torsion=1e6, bending=1e5, mass=m, inertia=polar)
    ways = np.arange(1, 3) * math.pi / length
    axial = frequencies(line, *straight(s), unknowns(n, (0,), {(0, 0), (n - 1, 0)}), 2)
    np.testing.assert_allclose(axial, ways * math.sqrt(1e8 / m), rtol=2e-3)  # (k h)^2 / 24
    torsional = frequencies(line, *straight(s), unknowns(n, (3,), {(0, 3), (n - 1, 3)}), 2)
    np.testing.assert_allclose(torsional, ways * math.sqrt(1e6 / polar), rtol=2e-3)


def test_frequency_of_a_hanging_chain():
    """omega = j_1 / 2 sqrt(w / (m L)), j_1 = 2.404826 the zero of the Bessel function J_0 (Bernoulli): weight and mass are two things."""
    n, length, weight, m = 33, 50.0, 150.0, 20.0
    s, line = bar(length, n, axial=1e8, shear=1e8, torsion=10.0, bending=1e2, mass=m, weight=weight, inertia=1e-6)
    position, attitude = straight(s, (0.0, 0.0, -1.0), UPRIGHT)
    hung = dense_equilibrium(line, position - position[-1], attitude, np.arange(6 * n - 6))
    got = frequencies(line, *hung, unknowns(n, (0, 4), {(n - 1, 0)}), 1)
    assert got[0] == pytest.approx(0.5 * 2.404825558 * math.sqrt(weight / (m * length)), rel=2e-3)
