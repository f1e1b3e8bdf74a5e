"""The static tangent, the verdict on stability and the descent: against differences, dense eigenvalues and the buckling of a column."""

import math

import numpy as np
import pytest
from pipe_helpers import STILL, assembled, bar, loaded, pitch, rotation, static_system, straight, turned
from scipy.linalg import eigh
from statics_grid import scenes

from pipe_fmu import Pipe, PipeUnit
from pipe_fmu.element.strains import frame
from pipe_fmu.line import Water
from pipe_fmu.loads.drag import add_mean_drag, add_static_drag
from pipe_fmu.statics.balance import Balance, Factors, Scales, _largest_eigenvalues, limited, moved
from pipe_fmu.statics.relaxation import DESCENTS, TOLERANCE, _downward, _step, descend, newton, relax

SCENES = scenes()


def free_motions(line, quaternion):
    """Columns: the motions (6 n,) that the ends leave free, by projection."""
    size = 6 * len(quaternion)
    held = [*range(6 if line.foot_clamped else 3), *range(size - 6, size if line.top_clamped else size - 3)]
    free = np.delete(np.eye(size), held, axis=1)
    if not line.foot_clamped:
        free[3:6, :3] = np.linalg.svd(rotation(quaternion[0])[:, :1].T)[2].T  # the first column turns about t1
        free = free[:, 1:]
    return free


def held_tangent(line, found, water):
    """Tangent of the free unknowns over the root of the metric, dense; and the neutral stiffness."""
    scales, free = Scales(line), free_motions(line, found.quaternion)
    tangent = static_system(line, found.position, found.quaternion, water)[1]
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
        add_mean_drag(*sides, np.zeros((2, 6)), depths, levels, flow, 0.0, False, vector, matrix, np.empty((2, 3, 12)))
    return vector, matrix


def test_drag_at_rest_is_that_of_a_step_without_motion_and_its_tangent_is_its_derivative():
    vector, matrix = drag_at(np.zeros(12), True)
    np.testing.assert_allclose(vector, drag_at(np.zeros(12), False)[0], rtol=1e-12, atol=1e-10)
    for k, unit in enumerate(np.eye(12)):
        expected = (drag_at(1e-6 * unit, False)[0] - drag_at(-1e-6 * unit, False)[0]) / 2e-6
        np.testing.assert_allclose(matrix[:, k], expected, rtol=1e-6, atol=1e-4)


def column(shortened, out_of_plane=1.0):
    """Balance of a straight standing column, clamped below and pinned above, pressed in by a share of its length; EI, L.

    out_of_plane: the bending stiffness there, over that in the x-z plane.
    """
    length, bending = 10.0, 1e4
    stiffness = {"axial": 1e7, "shear": 1e7, "torsion": 1e4, "bending": bending, "bending_3": out_of_plane * bending}
    s, line = bar(length, 33, **stiffness, weight=1.0, foot_clamped=True, top_clamped=False)
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


def at_rest(current, **changes):
    """Balance of a taut line in a current [m/s] across it, at the equilibrium in still water; it is at rest without one."""
    _, line = bar(20.0, 6, axial=1e5, shear=1e5, torsion=1e5, bending=100.0, weight=5.0, **changes)
    line = loaded(line, drag=np.full((5, 2), 40.0))
    position, quaternion = straight(np.linspace(0.0, 20.2, 6), (0.8, 0.0, -0.6), pitch(math.asin(0.6)))
    still = newton(Balance(line, STILL, Scales(line), (position, quaternion))).balance
    water = Water(np.array([-30.0, 0.0]), np.array([[0.0, current, 0.0], [0.1, 0.3 * current, 0.0]]), True)
    return Balance(line, water, Scales(line), still.pose) if current else still


def dense(balance):
    """(tangent over the metric, projected on the free motions, these motions): what pushes back against them."""
    free = free_motions(balance.line, balance.pose[1])
    return free.T @ assembled(*balance.tangent) @ free, free.T @ (balance.scales.metric.ravel()[:, None] * free), free


@pytest.mark.parametrize(
    ("block", "stable"),
    [
        ([[0.0, 0.0], [0.0, 0.0]], True),
        ([[0.0, 20.0], [0.0, 0.0]], True),  # pushes across what it feels: the symmetric part is not definite
        ([[4.0, 20.0], [-20.0, 4.0]], True),
        ([[-8.0, 0.0], [0.0, 0.0]], False),
        ([[-8.0, 20.0], [-20.0, -8.0]], False),  # pushes away in circles
        ([[0.0, 20.0], [20.0, 0.0]], False),
    ],
)
@pytest.mark.parametrize("ends", [{}, {"foot_clamped": False, "top_clamped": False}])
def test_a_line_is_stable_if_all_eigenvalues_of_its_tangent_have_positive_real_parts(block, stable, ends):
    """A taut line, softest at 5.4 or 1.2 1/m, with a part in its tangent as of a current, times the metric. Dense eigenvalues by LAPACK."""
    balance = at_rest(0.8, **ends)
    balance.tangent[0][:, 1:3, 1:3] += np.array(block) * balance.scales.metric[:, :1, None]
    stiffness, metric, _ = dense(balance)
    eigenvalues = np.linalg.eigvals(np.linalg.solve(metric, stiffness))
    assert (eigenvalues.real.min() > 0.0) == stable
    assert balance.stable() == stable
    assert balance.definite() == (np.linalg.eigvalsh(stiffness + stiffness.T)[0] > 0.0)


@pytest.mark.parametrize("size", [30, 200])
def test_arnoldis_method_finds_the_largest_eigenvalues(size):
    """Of a matrix that is not symmetric, with pairs, well apart; in fewer steps than its size or as many."""
    random = np.random.default_rng(size)
    values = np.sort(random.uniform(0.0, 0.5, size))
    values[-8:] = [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
    matrix = np.diag(values)
    matrix[-2:, -2:] = [[8.0, 5.0], [-5.0, 8.0]]
    basis = random.normal(size=(size, size)) + 3.0 * np.eye(size)
    matrix = basis @ matrix @ np.linalg.inv(basis)
    found = _largest_eigenvalues(lambda x: matrix @ x, np.ones(size))
    expected = np.array([8.0 + 5.0j, 8.0 - 5.0j, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0])
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-9)


def test_arnoldis_method_ends_where_its_vectors_do():
    """A start within four eigenvectors: four values, and no division by what is left of a fifth vector."""
    found = _largest_eigenvalues(lambda x: np.arange(1.0, 41.0) * x, np.append(np.ones(4), np.zeros(36)))
    np.testing.assert_allclose(np.sort(found.real), [1.0, 2.0, 3.0, 4.0], rtol=1e-12)


def test_energy_promised_by_a_move_is_that_released_to_third_order():
    balance = at_rest(0.0)
    move = np.random.default_rng(2).normal(size=balance.residual.shape) * [0.02, 0.02, 0.02, 0.005, 0.005, 0.005]
    move[0] = move[-1] = 0.0
    left = [balance.potential - balance.after(k * move).potential - balance.promise(k * move) for k in (1.0, 0.5)]
    assert left[0] / left[1] == pytest.approx(8.0, rel=0.2)
    assert abs(left[0]) < 0.1 * abs(balance.promise(move))


def test_a_step_of_descent_in_a_current_releases_what_it_promises():
    """To third order, the work of the drag counted in; and near the end too, where only the forces tell."""
    balance = at_rest(0.1)
    for _ in range(3):
        after, ratio = _step(balance, 0.0, 0.25, True)
        assert ratio == pytest.approx(1.0, abs=5e-3)
        assert after.size < 0.1 * balance.size
        balance = after
    assert balance.size < TOLERANCE
    assert newton(at_rest(0.1)).balance.size < TOLERANCE


def test_a_descent_ends_where_the_line_comes_back_though_its_tangent_is_not_definite():
    balance = newton(at_rest(0.1)).balance
    balance.tangent[0][:, 1:3, 1:3] += np.array([[0.0, 20.0], [0.0, 0.0]]) * balance.scales.metric[:, :1, None]
    found = descend(balance, 5)
    assert found.stable
    assert found.iterations == 0


def test_an_equilibrium_that_is_not_stable_is_left_for_one_that_is():
    found = relax(column(1e-3)[0], DESCENTS)
    assert found.stable
    assert np.abs(found.balance.pose[0][:, 0]).max() > 0.01


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("ends", [{}, {"foot_clamped": False, "top_clamped": False}])
def test_the_way_down_is_the_softest_mode_and_not_uphill(side, ends):
    """Lowest eigenvector of the tangent by the metric (scipy), its largest turn as told, against the residual; held ends stay."""
    balance = at_rest(0.0, **ends)
    balance.tangent[0][3] -= 2.0 * np.diag([0.0, balance.tangent[0][3][1, 1] / 3.0, 0.0, 0.0, 0.0, 0.0])
    stiffness, metric, free = dense(balance)
    values, vectors = eigh(0.5 * (stiffness + stiffness.T), metric)
    assert values[0] < 0.0 < values[1]
    softest = (free @ vectors[:, 0]).reshape(-1, 6)
    balance.residual[:] = side * balance.scales.metric * softest
    mode = _downward(balance, Factors(balance, -1.05 * values[0]), 0.1)
    assert np.abs(mode[:, 3:]).max() == pytest.approx(0.1)
    assert (mode * balance.residual).sum() < 0.0
    np.testing.assert_allclose(mode, -side * softest * (0.1 / np.abs(softest[:, 3:]).max()), atol=1e-6 * np.abs(mode).max())
    assert not mode[0, :3].any()
    assert not mode[-1, :3].any()


def test_a_column_leaves_a_saddle_by_a_way_that_no_residual_shows():
    """Softer out of its plane, where nothing pushes it, not even round-off: only the direction of negative curvature leads there."""
    straight, *_ = column(1.5e-3, 0.5)
    rest = newton(straight)
    assert not rest.stable
    assert not rest.balance.pose[0][:, 1].any()
    found = descend(rest.balance, DESCENTS)
    assert found.stable
    assert np.abs(found.balance.pose[0][:, 1]).max() > 0.01


def test_a_limited_move_turns_no_section_by_more_and_keeps_its_direction():
    move = np.random.default_rng(1).normal(size=(4, 6))
    largest = np.abs(move[:, 3:]).max()
    np.testing.assert_array_equal(limited(move, 1.01 * largest), move)
    np.testing.assert_allclose(limited(move, 0.1), move * 0.1 / largest, rtol=1e-14)


def test_a_line_is_measured_by_its_weight():
    """Forces by all of it, moments by the longest element times that; a node of length l by its share W, turning by W l^2 / 12."""
    _, line = bar(9.0, 3, axial=1e5, shear=1e5, torsion=80.0, bending=100.0)
    line = loaded(line._replace(length=np.array([3.0, 6.0])), weight=np.array([2.0, -4.0]))
    own = np.array([1.5, 4.5, 3.0])
    for weight, load in ((1.0, 30.0 / 9.0), (0.0, 100.0 / 9.0**3)):  # a line without weight by what buckles it, EI / L^2
        scales = Scales(loaded(line, weight=weight * line.loads.weight))
        assert scales.force == pytest.approx(9.0 * load)
        assert scales.longest == pytest.approx(6.0)
        np.testing.assert_allclose(scales.metric[:, 0], load * own)
        np.testing.assert_allclose(scales.metric[:, 4], load * own**3 / 12.0)


def test_attitudes_stay_of_unit_length():
    balance = at_rest(0.0)
    _, attitude = moved((balance.pose[0], 1.001 * balance.pose[1]), np.full(balance.residual.shape, 0.1))
    np.testing.assert_allclose(np.linalg.norm(attitude, axis=1), 1.0, rtol=1e-15)


def test_forces_on_held_ends_are_struck():
    for clamped in (True, False):
        balance = at_rest(0.5, top_clamped=clamped)
        forces = np.ones(balance.residual.shape)
        balance.hold(forces)
        np.testing.assert_array_equal(forces[-1], [0.0] * 6 if clamped else [0.0] * 3 + [1.0] * 3)
        assert not forces[0].any()
        assert forces[1:-1].all()
