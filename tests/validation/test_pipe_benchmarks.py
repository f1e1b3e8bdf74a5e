"""Benchmarks of the field on the element, the assembly and the mass, with both ends as the benchmark has them."""

import math

import numpy as np
import pytest
from pipe_helpers import (
    bar,
    dense_equilibrium,
    free_step,
    loaded,
    pitch,
    rotation,
    rotation_vector_quaternion,
    static_system,
    step_system,
    straight,
    turned,
)
from scipy.linalg import eigh
from scipy.optimize import brentq

from pipe_fmu.line import Water

UPRIGHT = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)  # t1 along -e3


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


def critical(load_of, low, high):
    """Load at which the tangent's lowest eigenvalue passes zero."""
    return brentq(load_of, low, high, rtol=1e-7)


def lowest(line, position, attitude, load=0.0):
    free = np.arange(6, 6 * len(position))
    found = dense_equilibrium(line, position, attitude, free, load)
    tangent = static_system(line, *found)[1][np.ix_(free, free)]
    return np.linalg.eigvalsh(0.5 * (tangent + tangent.T))[0]


def extrapolated(values):
    """Richardson's value of a second-order sequence at h and h / 2."""
    return values[1] + (values[1] - values[0]) / 3


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

    assert extrapolated([factor(9), factor(17)]) == pytest.approx(4.0126, rel=5e-4)


def test_lateral_buckling_of_a_cantilever_under_its_weight():
    """q L^3 / sqrt(EI GJ) = 12.85 (Timoshenko and Gere, 6.3): the sag's part of the tangent."""
    length, bending, torsion = 10.0, 1e3, 8e2

    def factor(n):
        def value(weight):
            load = weight * math.sqrt(bending * torsion) / length**3
            s, line = bar(length, n, axial=1e9, shear=1e9, torsion=torsion, bending=1e9, bending_3=bending, weight=load)
            return lowest(line, *straight(s))

        return critical(value, 12.0, 14.0)

    assert extrapolated([factor(9), factor(17)]) == pytest.approx(12.85, rel=1e-3)


def test_self_buckling_of_a_standing_column():
    """w L^3 / EI = 7.8373 (Greenhill 1881), with eight elements to 1e-4."""
    length, bending, n = 10.0, 1e3, 9

    def value(weight):
        s, line = bar(length, n, axial=1e9, shear=1e9, torsion=bending, bending=bending, weight=weight * bending / length**3)
        return lowest(line, *straight(s, (0.0, 0.0, -1.0), UPRIGHT))

    assert critical(value, 7.0, 8.5) == pytest.approx(7.8373, rel=1e-4)


def test_loads_turn_and_unload_leave_no_strain():
    """Path independence and frame indifference: loaded, turned by 2 rad as a whole, unloaded."""
    s, line = bar(10.0, 6, axial=1e5, shear=5e4, torsion=80.0, bending=120.0, bending_3=90.0)
    load = np.zeros(36)
    load[-6:] = [-3.0, 2.0, 4.0, 2.0, -5.0, 3.0]
    free = np.arange(6, 36)
    position, attitude = dense_equilibrium(line, *straight(s), free, load)
    assert sum(static_system(line, position, attitude)[2]) > 1.0
    turn = rotation_vector_quaternion((0.8, -1.6, 0.9))
    r = rotation(turn)
    theta = np.tile([0.8, -1.6, 0.9], (6, 1))
    position, attitude = position @ r.T, turned(position, attitude, np.hstack([0 * position, theta]))[1]
    back = dense_equilibrium(line, position, attitude, free)
    residual, _, potentials = static_system(line, *back)
    assert sum(potentials) < 1e-20
    np.testing.assert_allclose(residual, 0.0, atol=1e-7)
    np.testing.assert_allclose(back[0], straight(s)[0] @ r.T, atol=1e-9)


def test_static_residual_is_the_gradient_of_the_potentials():
    """Elastic and gravity: every nodal unknown of a random line, by central differences."""
    random = np.random.default_rng(0)
    n = 5
    s, line = bar(40.0, n, axial=5e5, shear=2e5, torsion=8e4, bending=2e5, bending_3=5e5, weight=700.0)
    x = random.normal(size=(n, 6)) * [0.3, 0.3, 0.3, 0.2, 0.2, 0.2]
    at = turned(*straight(s), x)
    residual, tangent, _ = static_system(line, *at)
    step = 1e-5
    for k in range(6 * n):
        d = np.zeros(6 * n)
        d[k] = step
        up, down = (static_system(line, *turned(*at, sign * d.reshape(n, 6))) for sign in (1, -1))
        assert (sum(up[2]) - sum(down[2])) / (2 * step) == pytest.approx(residual[k], rel=1e-6, abs=1e-7 * np.abs(residual).max())
        np.testing.assert_allclose(tangent[:, k], (up[0] - down[0]) / (2 * step), atol=1e-7 * np.abs(tangent).max())


def matrices(line, position, attitude):
    """(mass, stiffness): the tangent of a step from rest is 2 M / h^2 + K / 2, for any h."""
    n = len(position)
    rest = position, attitude, np.zeros((n, 3)), np.zeros((n, 3))
    one, two = (step_system(line, rest, np.zeros((n, 6)), h)[1] for h in (1e-3, 2e-3))
    mass = (one - two) / (2 * (1e6 - 0.25e6))
    return mass, 2 * (one - 2e6 * mass)


def frequencies(line, position, attitude, unknowns, count):
    """Lowest circular frequencies [rad/s] with only `unknowns` free."""
    mass, stiffness = (m[np.ix_(unknowns, unknowns)] for m in matrices(line, position, attitude))
    values = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T), eigvals_only=True)
    return np.sqrt(values[:count])


def unknowns(n, kinds, held):
    """Indices of the unknowns `kinds` (0-5) of all nodes but the pairs (node, kind) `held`."""
    return np.array([6 * i + k for i in range(n) for k in kinds if (i, k) not in held])


def test_tangent_of_a_step_at_rest_is_mass_and_stiffness():
    s, line = bar(100.0, 9, axial=1e7, shear=1e7, torsion=1e5, bending=1e5, weight=300.0, mass=20.0)
    position, attitude = turned(*straight(s), 0.01 * np.random.default_rng(1).normal(size=(9, 6)))
    mass, stiffness = matrices(line, position, attitude)
    np.testing.assert_allclose(stiffness, static_system(line, position, attitude)[1], atol=1e-9 * np.abs(stiffness).max())
    np.testing.assert_allclose(mass[::6, ::6].sum(), 20.0 * 100.0, rtol=1e-6)  # the whole mass moves


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


@pytest.mark.parametrize("along", [False, True])
def test_sinking_line_reaches_its_terminal_velocity(along):
    """v = sqrt(w / (rho d D / 2)) across and along; from rest v(t) = v tanh(w t / (m v))."""
    weight, mass, across, lengthwise = 300.0, 40.0, 120.0, 3.0
    s, line = bar(60.0, 7, axial=1e8, shear=1e10, torsion=1e9, bending=1e9, mass=mass, weight=weight)
    line = loaded(line, drag=np.tile([lengthwise, across], (6, 1)))
    position, attitude = straight(s, (0.0, 0.0, -1.0), UPRIGHT) if along else straight(s)
    terminal = math.sqrt(weight / (lengthwise if along else across))
    water = Water(np.zeros(0), np.zeros((0, 3)), True)
    fall = np.tile([0.0, 0.0, terminal], (7, 1))
    state = free_step(line, (position, attitude, fall, np.zeros((7, 3))), 0.5, water)
    np.testing.assert_allclose(state[2], fall, atol=1e-8 * terminal)
    end = 1.5 * mass * terminal / weight
    speeds = []
    for count in (10, 20):
        state = position, attitude, np.zeros((7, 3)), np.zeros((7, 3))
        for _ in range(count):
            state = free_step(line, state, end / count, water)
        speeds.append(state[2][3, 2])
    exact = terminal * math.tanh(1.5)
    assert speeds[1] == pytest.approx(exact, rel=2e-3)
    assert abs(speeds[0] - exact) / abs(speeds[1] - exact) > 3.5  # second order
