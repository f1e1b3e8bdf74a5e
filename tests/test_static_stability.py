"""The static tangent, the verdict on stability and the descent: against differences, dense eigenvalues and the buckling of a column."""

import math

import numpy as np
import pytest
from pipe_helpers import STILL, bar, pitch, rotation, static_system, turned
from statics_grid import scenes

from pipe_fmu import Pipe, PipeUnit
from pipe_fmu.element import frame
from pipe_fmu.loads import add_drag
from pipe_fmu.relaxation import DESCENTS, descend, newton
from pipe_fmu.static_balance import Balance, Scales
from pipe_fmu.static_drag import add_static_drag

SCENES = scenes()


def held_tangent(line, found, water):
    """Tangent of the free unknowns over the root of the metric, dense, by projection; and the neutral stiffness."""
    scales = Scales(line)
    tangent = static_system(line, found.position, found.quaternion, water)[1]
    size = len(tangent)
    free = np.delete(np.eye(size), [*range(3), *range(size - 6, size - 3)], axis=1)  # both ends hold their places
    if line.foot_clamped:
        free = free[:, 3:]
    else:
        axis = rotation(found.quaternion[0])[:, 0]
        free[3:6, :3] = np.linalg.svd(axis[None])[2].T  # the first column turns about t1
        free = free[:, 1:]
    root = 1.0 / np.sqrt((free.T @ (scales.metric.ravel()[:, None] * free)).diagonal())
    return root[:, None] * (free.T @ tangent @ free) * root, scales.neutral


@pytest.mark.parametrize("number", [7, 14, 33, 53, 73, 110, 137, 171, 188, 198])
def test_a_line_called_stable_has_a_definite_tangent(number):
    """Dense eigenvalues of the symmetric part, ends held by projection: on and off the bed, in and out of a current, any foot."""
    pipe = Pipe(SCENES[number].parameters)
    found = pipe.equilibrium(pipe.parameters.top_position, None)
    tangent, neutral = held_tangent(pipe.line._replace(top_clamped=False), found, pipe.water(0.0))
    assert found.stable
    assert np.linalg.eigvalsh(0.5 * (tangent + tangent.T))[0] > -1.001 * neutral
    assert np.linalg.eigvals(tangent).real.min() > -1.001 * neutral


@pytest.mark.parametrize("number", [23, 53, 137])
def test_static_tangent_is_the_derivative_of_the_residual_on_the_bed_and_in_a_current(number):
    pipe = Pipe(SCENES[number].parameters)
    found = pipe.equilibrium(pipe.parameters.top_position, None)
    water = pipe.water(0.0)
    x = np.random.default_rng(number).standard_normal((len(pipe.s), 6)) * [1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6]
    up, down = (static_system(pipe.line, *turned(found.position, found.quaternion, k * x), water)[0] for k in (1, -1))
    expected = (0.5 * (up - down)).reshape(-1, 6)
    tangent = static_system(pipe.line, found.position, found.quaternion, water)[1]
    error = np.abs((tangent @ x.ravel()).reshape(-1, 6) - expected)
    assert error[:, :3].max() < 1e-6 * np.abs(expected[:, :3]).max()
    assert error[:, 3:].max() < 1e-6 * np.abs(expected[:, 3:]).max()


def test_static_tangent_of_a_calm_equilibrium_is_symmetric():
    """On the bed: a missing part of the reaction's tangent, at the free nodes, would show here."""
    pipe = Pipe(SCENES[23].parameters)
    found = pipe.equilibrium(pipe.parameters.top_position, None)
    tangent = held_tangent(pipe.line._replace(top_clamped=False), found, STILL)[0]
    assert np.abs(tangent - tangent.T).max() < 1e-9 * np.abs(tangent).max()


def drag_at(x, fresh):
    """Minus the drag (12,) on a bent element after displacements and spins x (2, 6), and its tangent."""
    position, quaternion = turned(
        np.array([[0.0, 0.0, -50.0], [9.7, 0.6, -51.0]]), np.array([pitch(0.1), [0.98, 0.1, 0.15, 0.05]]), x.reshape(2, 6)
    )
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, None]
    rm, u, psi = frame(tuple(quaternion[0]), tuple(quaternion[1]), tuple(position[1] - position[0]))
    levels, flow = np.array([-60.0, -40.0]), np.array([[0.3, 0.8, 0.1], [-0.2, 0.1, 0.0]])
    vector, matrix, depths = np.zeros(12), np.zeros((12, 12)), position[:, 2].copy()
    sides = rm, u, psi, 10.0, np.array([7.0, 200.0])
    if fresh:
        add_static_drag(*sides, *depths, levels, flow, vector, matrix)
    else:
        add_drag(*sides, np.zeros((2, 6)), depths, levels, flow, 0.0, False, vector, matrix, np.empty((2, 3, 12)))
    return vector, matrix


def test_drag_at_rest_is_that_of_a_step_without_motion_and_its_tangent_is_its_derivative():
    vector, matrix = drag_at(np.zeros(12), True)
    np.testing.assert_allclose(vector, drag_at(np.zeros(12), False)[0], rtol=1e-12, atol=1e-10)
    for k, unit in enumerate(np.eye(12)):
        expected = (drag_at(1e-6 * unit, False)[0] - drag_at(-1e-6 * unit, False)[0]) / 2e-6
        np.testing.assert_allclose(matrix[:, k], expected, rtol=1e-6, atol=1e-4)


def column(shortened):
    """Balance of a straight standing column, clamped below and pinned above, pressed in by a share of its length; EI, L."""
    length, bending = 10.0, 1e4
    s, line = bar(length, 33, axial=1e7, shear=1e7, torsion=1e4, bending=bending, weight=1.0, foot_clamped=True, top_clamped=False)
    position = np.outer(s * (1.0 - shortened), [0.0, 0.0, -1.0])
    return Balance(line, STILL, Scales(line), (position, np.tile(pitch(0.5 * math.pi), (33, 1)))), bending, length


@pytest.mark.parametrize(("load", "stable"), [(0.97, True), (1.03, False)])
def test_a_column_is_stable_up_to_eulers_load(load, stable):
    """P = 20.1907 EI / L^2, clamped and pinned."""
    _, bending, length = column(0.0)
    straight, *_ = column(load * 20.1907 * bending / length**2 / 1e7)
    rest = newton(straight)
    assert rest.converged
    assert rest.stable == stable


def test_a_column_past_eulers_load_buckles_to_a_stable_shape_of_less_energy():
    """From the exact saddle, where no residual tells the way; just past buckling the load stays Euler's."""
    straight, bending, length = column(1e-3)
    rest = newton(straight)
    assert rest.converged
    assert not rest.stable
    found = descend(rest.balance, DESCENTS)
    assert found.stable
    assert found.balance.potential < rest.balance.potential
    assert found.balance.top[2] == pytest.approx(20.1907 * bending / length**2, rel=5e-3)


def test_a_unit_that_starts_in_an_equilibrium_that_is_not_stable_says_so(monkeypatch):
    unit, found = PipeUnit(SCENES[33].parameters), Pipe(SCENES[33].parameters).start(0.0)
    assert unit.initialize(0.0, {}) is None
    assert not unit.remark
    monkeypatch.setattr(Pipe, "start", lambda self, time: (found[0]._replace(stable=False), found[1]))
    assert unit.initialize(0.0, {}) is None
    assert "not stable" in unit.remark
