"""The vessel's step: energy identity, power at the hang-off point, mobility, orders, published periods, rollback."""

import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from vessel_fmu.attitude import exp_quaternion, rotation_matrix
from vessel_fmu.environment import Current, Environment
from vessel_fmu.parameters import AddedMass, Controller, LinearDamping, Start, VesselParameters
from vessel_fmu.vessel import Inputs, Vessel

SEA = Environment(current=Current(velocity=(0.3, 0.8, 0.0)))
PARAMETERS = VesselParameters(hang_off=(-38.0, 4.0, 2.5), hold_force=(3e5, -1e5, 4e6), environment=SEA)
CONSERVATIVE = replace(PARAMETERS, hold_force=(0.0, 0.0, 0.0), damping=None, drag=None)


def random_state(vessel, rng, rate):
    return vessel.start()._replace(
        position=rng.normal(size=3),
        quaternion=exp_quaternion(rng.normal(size=3), 4.0 * rate),
        body_velocity=np.concatenate([rng.normal(size=3), rate * rng.normal(size=3)]),
    )


def bits(state):
    """Every number of a state, bit by bit."""
    return [np.asarray(leaf).tobytes() for leaf in (*state[:-1], *state.control)]


def random_inputs(rng):
    return Inputs(*(size * rng.normal(size=3) for size in (1e6, 1e7, 1e5, 1e6, 1e7, 1e6, 1e7)))


def energy(vessel, state):
    return vessel.kinetic_energy(state) + vessel.restoring_energy(state)


@pytest.mark.parametrize("rate", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("h", [1e-13, 1e-10, 1e-6, 1e-3, 0.02, 0.1, 0.5, 1.0, 2.0, 5.0])
def test_energy_balance_is_exact_for_any_step(h, rate):
    """Energy change = works - dissipations to 1e-13 of the works (plus the round-off of the energies themselves).

    Steps in which the hull turns by 2.5 rad and more find no solution once in a hundred, and are then refused.
    """
    rng = np.random.default_rng(int(1000 * h) + int(100 * rate))
    vessel, refused = Vessel(PARAMETERS), 0
    for _ in range(10):
        old = random_state(vessel, rng, rate)
        result = vessel.step(old, 0.0, h, random_inputs(rng))
        if not result.converged and h * rate >= 2.5:
            refused += 1
            continue
        assert result.converged
        bond, control, environment, current, damping, drag = result.state.works
        assert damping >= 0.0
        assert drag >= 0.0
        closure = energy(vessel, result.state) - energy(vessel, old) - (bond + control + environment + current - damping - drag)
        round_off = 8 * np.finfo(float).eps * (energy(vessel, result.state) + energy(vessel, old))
        assert abs(closure) < 1e-13 * np.abs(result.state.works).sum() + round_off
    assert refused <= 1


@pytest.mark.parametrize("h", [0.01, 0.5, 5.0])
def test_work_at_the_hang_off_point_is_the_work_of_its_own_motion(h):
    """h (f . v + m . w) with v the chord of the point over h and w the rotation vector over h: the bond's exact product."""
    rng = np.random.default_rng(7)
    vessel = Vessel(PARAMETERS)
    for _ in range(10):
        old, inputs = random_state(vessel, rng, 0.2), random_inputs(rng)
        new = vessel.step(old, 0.0, h, inputs).state
        (before, _), (after, _) = (vessel.hang_off_pose(vessel.position(s), s.quaternion) for s in (old, new))
        turn = Rotation.from_matrix(rotation_matrix(new.quaternion) @ rotation_matrix(old.quaternion).T).as_rotvec()
        w = new.mean_velocity[3:]
        assert_allclose(new.mean_velocity[:3], (after - before) / h, atol=1e-12 / h)
        assert_allclose(Rotation.from_rotvec(h * w).as_matrix(), Rotation.from_rotvec(turn).as_matrix(), atol=1e-14)
        work = h * (inputs.force @ new.mean_velocity[:3] + inputs.moment @ w)
        assert_allclose(new.works[0], work, rtol=1e-13)


@pytest.mark.parametrize("h", [0.02, 0.5, 2.0])
def test_mobility_is_the_derivative_of_the_step(h):
    rng = np.random.default_rng(3)
    vessel = Vessel(PARAMETERS)
    old, inputs = random_state(vessel, rng, 0.1), random_inputs(rng)
    scale = np.array([1e3] * 3 + [1e5] * 3) / min(h, 1.0)
    columns = []
    for i, d in enumerate(scale):
        force, moment = np.split(d * np.eye(6)[i], 2)
        ahead = vessel.step(old, 0.0, h, inputs._replace(force=inputs.force + force, moment=inputs.moment + moment))
        behind = vessel.step(old, 0.0, h, inputs._replace(force=inputs.force - force, moment=inputs.moment - moment))
        columns.append((ahead.state.mean_velocity - behind.state.mean_velocity) / (2.0 * d))
    differences, mobility = np.column_stack(columns), vessel.step(old, 0.0, h, inputs).state.mobility
    weight = np.sqrt(np.outer(1.0 / np.diag(mobility), 1.0 / np.diag(mobility)))
    assert_allclose(weight * mobility, weight * differences, atol=1e-6)


def test_mobility_of_a_short_step_is_half_the_step_over_the_inertia_at_the_point():
    """Y -> h/2 J M^-1 J^T, symmetric positive definite: the vessel as the bond feels it."""
    vessel, h = Vessel(CONSERVATIVE), 1e-4
    mobility = vessel.step(vessel.start(), 0.0, h, Inputs()).state.mobility
    x, y, z = CONSERVATIVE.hang_off
    lever = np.eye(6)
    lever[:3, 3:] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    expected = 0.5 * h * lever @ np.linalg.inv(vessel.hull.mass) @ lever.T
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert_allclose(mobility / scale, expected / scale, atol=1e-6)
    assert np.linalg.eigvalsh(mobility + mobility.T)[0] > 0.0


def run(vessel, state, duration, steps, inputs):
    h = duration / steps
    for k in range(steps):
        state = vessel.step(state, k * h, h, inputs).state
    return state


def test_step_is_second_order_in_time():
    """Also with loads, lever arm and large turns: halving the step divides the error by four."""
    rng = np.random.default_rng(5)
    vessel, duration = Vessel(PARAMETERS), 4.0
    start = random_state(vessel, rng, 0.1)
    inputs = Inputs(force=np.array([-4e5, 1e5, 9e5]), moment=np.array([2e7, -1e8, 1e8]), control_force=np.array([3e5, 1e5, 1e7]))
    ends = [run(vessel, start, duration, steps, inputs) for steps in (40, 80, 160, 320)]
    for pick in (lambda s: s.position, lambda s: s.quaternion, lambda s: s.body_velocity[:3], lambda s: s.body_velocity[3:]):
        coarse, middle, fine = (np.linalg.norm(pick(b) - pick(a)) for a, b in pairwise(ends))
        assert np.log2(coarse / middle) == pytest.approx(2.0, abs=0.1)
        assert np.log2(middle / fine) == pytest.approx(2.0, abs=0.1)


def test_free_body_in_ideal_fluid_keeps_kirchhoffs_impulse():
    """No restoring, damping or load: the spatial impulse is conserved, so the motion solves a first-order system in the pose alone."""
    free = replace(
        CONSERVATIVE,
        waterplane_area=1e-9,
        metacentric_height=1e-12,
        longitudinal_metacentric_height=1e-12,
        added_mass=AddedMass(heave_pitch=6e7, sway_roll=5e5, roll_yaw=-4e7),
        start=Start(position=(0.0, 0.0, -800.0), velocity=(1.0, -0.6, 0.3), angular_velocity=(0.05, -0.08, 0.06)),
    )
    vessel = Vessel(free)
    state = vessel.start()
    mass = vessel.hull.mass
    linear, angular = np.split(mass @ state.body_velocity, 2)  # pose is the identity

    def rates(_, pose):
        rotation = pose[3:].reshape(3, 3)
        nu = np.linalg.solve(mass, np.concatenate([rotation.T @ linear, rotation.T @ (angular - np.cross(pose[:3], linear))]))
        return np.concatenate([rotation @ nu[:3], np.cross(rotation, nu[3:]).ravel()])

    exact = solve_ivp(rates, (0.0, 20.0), np.concatenate([np.zeros(3), np.eye(3).ravel()]), rtol=1e-11, atol=1e-12).y[:, -1]
    errors = []
    for steps in (200, 400):
        end = run(vessel, state, 20.0, steps, Inputs())
        pose = np.concatenate([end.position, rotation_matrix(end.quaternion).ravel()])
        errors.append(np.abs(pose - exact).max())
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


UNCOUPLED = VesselParameters(  # heave and pitch
    flotation_centre=0.0,
    longitudinal_metacentric_height=103.628,
    added_mass=AddedMass(heave_pitch=0.0),
    damping=LinearDamping(heave_pitch=0.0),
)
FREE_DECAY = {  # stiffness, M_ii, damping of MSS supply; published undamped period; released by
    "heave": (13910359.0, 6362208.5 + 7897997.9, 5822239.1, 6.36, {"position": (0.0, 0.0, -799.5)}),
    "roll": (133797350.0, 287307129.1 + 88812376.3, 4466529.3 + 3.0e7, 10.53, {"attitude": (np.radians(3.0), 0.0, 0.0)}),
    "pitch": (6467778000.0, 2726142869.1 + 3357171472.8, 3361475932.6, 6.09, {"attitude": (0.0, np.radians(1.0), 0.0)}),
}


@pytest.mark.parametrize("mode", FREE_DECAY)
def test_free_decay_has_the_period_and_damping_of_mss_supply(mode):
    stiffness, mass, damping, published, release = FREE_DECAY[mode]
    vessel, h = Vessel(replace(UNCOUPLED, start=Start(**({"position": (0.0, 0.0, -800.0)} | release)))), 0.02
    state, motion, energies = vessel.start(), [], []
    for k in range(2000):
        motion.append({"heave": state.position[2], "roll": state.quaternion[1], "pitch": state.quaternion[2]}[mode])
        energies.append(energy(vessel, state))
        state = vessel.step(state, k * h, h, Inputs()).state
    x = np.array(motion)
    crossing = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    times = h * (crossing + x[crossing] / (x[crossing] - x[crossing + 1]))
    half_periods = np.diff(times)[:4]
    decay, undamped = 0.5 * damping / mass, np.sqrt(stiffness / mass)
    damped_period = 2.0 * np.pi / np.sqrt(undamped**2 - decay**2)
    assert_allclose(2.0 * half_periods, damped_period, rtol=5e-3)
    assert 2.0 * half_periods.mean() * np.sqrt(1.0 - (decay / undamped) ** 2) == pytest.approx(published, rel=0.01)
    first, second = (np.abs(x[a:b]).max() for a, b in pairwise(crossing[:3]))
    assert np.log(first / second) == pytest.approx(0.5 * decay * damped_period, rel=0.02)
    assert np.diff(energies).max() <= 1e-12 * max(energies)


MSS_C = np.array([[13910359.0, 70729128.0], [70729128.0, 6467778000.0]])  # C_33, C_35, C_55 about the centre of gravity, ShipX
MSS_A = np.array([[7.8790e6, 5.2935e7], [5.2935e7, 3.3998e9]])  # A and B of the same data at 1 rad/s
MSS_B = np.array([[5.7676e6, 5.7979e7], [5.7979e7, 3.3921e9]])
RIGID = np.diag([6362208.5, 2726142869.1])


def heave_and_pitch(stiffness, mass, damping):
    """Matrix (4, 4) of the linear system of heave, pitch and their rates."""
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])


def test_heave_and_pitch_oscillate_together_as_the_linear_system_with_the_data_of_mss_supply():
    """A small release against the matrix exponential, with the data's C and the vessel's own M and D; second order in the step."""
    vessel = Vessel(VesselParameters(start=Start(position=(0.0, 0.0, -799.99), attitude=(0.0, 1e-3, 0.0))))
    system = heave_and_pitch(MSS_C, *(matrix[np.ix_([2, 4], [2, 4])] for matrix in (vessel.hull.mass, vessel.hull.damping)))
    size, errors = np.array([1e-2, 1e-3]), []
    for steps in (300, 600):
        end = run(vessel, vessel.start(), 6.0, steps, Inputs())
        errors.append(np.abs((end.position[2], 2.0 * end.quaternion[2]) - (expm(6.0 * system) @ [*size, 0.0, 0.0])[:2]) / size)
    assert errors[1].max() < 5e-4
    assert (errors[0] / errors[1] > 2.5).all()


def test_heave_and_pitch_have_the_natural_periods_of_the_frequency_dependent_data():
    """Eigenvalues of the linearised heave-pitch problem against those with A and B of the data at their frequency, 1 rad/s."""
    vessel = Vessel(VesselParameters())
    mass, damping = (matrix[np.ix_([2, 4], [2, 4])] for matrix in (vessel.hull.mass, vessel.hull.damping))
    own, data = (np.linalg.eigvals(heave_and_pitch(MSS_C, m, d)) for m, d in ((mass, damping), (RIGID + MSS_A, MSS_B)))
    periods = [np.sort(2.0 * np.pi / np.abs(values[values.imag > 0.0])) for values in (own, data)]
    assert_allclose(periods[1], (6.05, 6.50), atol=0.01)
    assert_allclose(*periods, rtol=0.01)


def test_static_heave_heel_and_trim_are_those_of_the_stiffness_of_mss_supply():
    """Under a small force and moments at the centre of gravity the hull rests at C^-1 F: a heave force alone trims it."""
    vessel, force, (roll, pitch) = Vessel(VesselParameters()), 1e5, (1e6, -2e6)
    state = vessel.start()
    for load in (Inputs(environment_force=np.array([0.0, 0.0, force])), Inputs(environment_moment=np.array([roll, pitch, 0.0]))):
        end = run(vessel, state, 400.0, 2000, load)
        heave, trim = np.linalg.solve(MSS_C, [load.environment_force[2], load.environment_moment[1]])
        assert_allclose((end.position[2], 2.0 * end.quaternion[2]), (heave, trim), rtol=1e-3)
        assert_allclose(2.0 * end.quaternion[1], load.environment_moment[0] / 133797350.0, rtol=1e-3, atol=1e-6)


def equations(parameters, loads):
    """Right-hand side of eq. (48) written afresh: pose and body velocity (18,), loads(t) force and moment in e, in b."""
    hull, drag, gravity = Vessel(parameters).hull, parameters.drag, 9.81
    mass, damping = hull.mass, hull.damping
    lift, aft = 1025.0 * gravity * parameters.waterplane_area, np.array([parameters.flotation_centre, 0.0, 0.0])
    station, share = np.polynomial.legendre.leggauss(8)
    station = drag.midship + 0.5 * drag.length * station
    strip = 0.25 * 1025.0 * drag.draft * drag.length * drag.cross_flow_coefficient * share
    frontal = 0.5 * 1025.0 * drag.draft * drag.beam * drag.surge_coefficient
    metacentric = gravity * parameters.mass * np.array([parameters.longitudinal_metacentric_height, parameters.metacentric_height])

    def rates(time, y):
        position, rotation, nu = y[:3], y[3:12].reshape(3, 3), y[12:]
        v, w = nu[:3], nu[3:]
        force_e, moment_e, force_b, moment_b = loads(time)
        down, (linear, angular) = rotation[2], np.split(mass @ nu, 2)
        buoyancy = -lift * (position + rotation @ aft)[2] * down
        speed = nu[1] + station * nu[5]
        across = strip * np.abs(speed) * speed
        force = rotation.T @ force_e + force_b + buoyancy - np.cross(w, linear)
        force -= [frontal * abs(nu[0]) * nu[0], across.sum(), 0.0]
        moment = rotation.T @ moment_e + moment_b + np.cross(aft, buoyancy) - np.cross(w, angular) - np.cross(v, linear)
        for stiffness, slope, axis in zip(metacentric, down, np.eye(3), strict=False):
            moment -= stiffness * slope * np.cross(axis, down)
        moment[2] -= (station * across).sum()
        spin = np.cross(rotation, w)  # rows: R [w]x
        return np.concatenate([rotation @ v, spin.ravel(), np.linalg.solve(mass, np.concatenate([force, moment]) - damping @ nu)])

    return rates


@pytest.mark.parametrize(("frame", "largest"), [("e", 180.0), ("b", 0.0)])
def test_a_pitch_moment_capsizes_a_hull_off_its_axis_if_it_is_given_in_e_and_not_if_in_b(frame, largest):
    """3e8 N m at 9 s, hull 0.5 rad off course, against RK45 of eq. (48): in e the moment heels it with up to 3e8 sin(0.5) N m, twice the
    67 MN m at 45 degrees beyond which no hull of this GM_T comes back.
    """
    vessel, duration = Vessel(VesselParameters(start=Start(position=(0.0, 0.0, -800.0), attitude=(0.0, 0.0, 0.5)))), 20.0

    def loads(time):
        moment, zero = np.array([0.0, 3e8 * np.sin(2.0 * np.pi * time / 9.0), 0.0]), np.zeros(3)
        return (zero, moment, zero, zero) if frame == "e" else (zero, zero, zero, moment)

    start = np.concatenate([np.zeros(3), rotation_matrix(vessel.start().quaternion).ravel(), np.zeros(6)])
    found = solve_ivp(equations(vessel.parameters, loads), (0.0, duration), start, rtol=1e-10, atol=1e-10, max_step=0.1)
    assert found.success
    heeled = np.degrees(np.abs(np.arctan2(found.y[10], found.y[11])))
    assert (heeled.max() > 102.0) if largest else (heeled.max() < 1e-9)
    errors = []
    for steps in (200, 400, 800):
        state, h = vessel.start(), duration / steps
        for k in range(steps):
            inputs = Inputs(*Inputs()[:3], *loads((k + 0.5) * h))
            state = vessel.step(state, k * h, h, inputs).state
        errors.append(np.abs(rotation_matrix(state.quaternion).ravel() - found.y[3:12, -1]).max())
    assert errors[-1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_released_heave_stays_bounded():
    """With the printed sign of (54) a release of 0.5 m grows to 1e6 m in 17 s."""
    vessel = Vessel(replace(UNCOUPLED, damping=None, drag=None, start=Start(position=(0.0, 0.0, -799.5))))
    state = vessel.start()
    heave = []
    for k in range(400):
        state = vessel.step(state, 0.1 * k, 0.1, Inputs()).state
        heave.append(state.position[2])
    assert max(heave) == pytest.approx(0.5, rel=1e-2)
    assert min(heave) == pytest.approx(-0.5, rel=1e-2)


@pytest.mark.parametrize("h", [0.05, 0.2, 1.0])
def test_without_damping_and_load_energy_is_kept(h):
    vessel = Vessel(replace(CONSERVATIVE, start=Start(position=(0.0, 0.0, -799.0), attitude=(0.3, -0.1, 0.5), velocity=(2.0, 1.0, 0.0))))
    state = vessel.start()
    before = energy(vessel, state)
    for k in range(300):
        state = vessel.step(state, k * h, h, Inputs()).state
    assert energy(vessel, state) == pytest.approx(before, rel=1e-11)


def test_hull_drifts_with_the_current():
    """In a steady surface current, nothing else acting, the hull ends up moving with the water and draws no more energy."""
    vessel = Vessel(replace(VesselParameters(), environment=SEA))
    state = run(vessel, vessel.start(), 2000.0, 2000, Inputs())
    later = vessel.step(state, 2000.0, 1.0, Inputs()).state
    assert_allclose(later.mean_velocity[:2], (0.3, 0.8), rtol=1e-2)
    assert abs(later.works[3] - state.works[3]) < 1e-4 * state.works[3]


def test_loads_along_the_axes_move_the_vessel_along_them():
    """Signs of all force ports: a push along an axis of e (b for the control port) gives motion along it, a moment a turn about it."""
    vessel, h, start = Vessel(VesselParameters()), 0.1, Vessel(VesselParameters()).start()
    for port, kind in (("force", 0), ("moment", 3), ("environment_force", 0), ("environment_moment", 3)):
        for i, unit in enumerate(np.eye(3)):
            moved = vessel.step(start, 0.0, h, Inputs()._replace(**{port: 1e5 * unit})).state.mean_velocity
            assert moved[kind + i] > 0.0
            assert np.argmax(np.abs(moved[kind : kind + 3])) == i
    turned = Vessel(VesselParameters(start=Start(attitude=(0.0, 0.0, np.pi / 2))))
    for port, kind in (("environment_force_b", 0), ("environment_moment_b", 3)):
        for i in range(3):
            moved = turned.step(turned.start(), 0.0, h, Inputs()._replace(**{port: 1e5 * np.eye(3)[i]})).state.body_velocity
            assert moved[kind + i] > 0.0
            assert np.argmax(np.abs(moved[kind : kind + 3])) == i
    for i, axis in enumerate((0, 1, 5)):
        moved = vessel.step(start, 0.0, h, Inputs(control_force=1e5 * np.eye(3)[i])).state.body_velocity
        assert moved[axis] > 0.0
    moved = turned.step(turned.start(), 0.0, h, Inputs(control_force=np.array([1e5, 0.0, 0.0]))).state
    assert moved.mean_velocity[1] > 100.0 * abs(moved.mean_velocity[0])


def test_equilibrium_of_the_static_load_is_one_of_the_step():
    """Hull in a current, pulled at r_t: where static load, pull and its moment balance, the step leaves the vessel at rest."""
    sea = Environment(current=Current(velocity=(0.4, 0.8, 0.0)))
    for pose in ((0.02, -0.03, 0.4), (0.0, 0.0, 0.0)):
        parameters = VesselParameters(hang_off=(-35.0, 3.0, 2.0), environment=sea, start=Start(position=(1.0, 2.0, -799.9), attitude=pose))
        vessel = Vessel(parameters)
        state = vessel.start()
        force, moment = vessel.static_load(vessel.position(state), state.quaternion, vessel.surface_current(0.0))
        lever_moment = vessel.moment_about_centre(state.quaternion, -force, np.zeros(3))
        result = vessel.step(state, 0.0, 1.0, Inputs(force=-force, moment=-moment - lever_moment))
        assert np.abs(result.state.body_velocity).max() < 1e-13


def test_held_section_is_pitched_by_the_departure_angle():
    """R_t = R_b R_y(alpha): t1 lies alpha above the bow direction, z down."""
    vessel = Vessel(VesselParameters(departure_angle=1.176, hang_off=(-40.0, 0.0, 3.0), start=Start(attitude=(0.0, 0.0, 0.5))))
    state = vessel.start()
    point, held = vessel.hang_off_pose(vessel.position(state), state.quaternion)
    bow = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    assert_allclose(rotation_matrix(held)[:, 0], np.cos(1.176) * bow - np.sin(1.176) * np.array([0.0, 0.0, 1.0]), atol=1e-15)
    assert_allclose(point, vessel.position(state) - 40.0 * bow + np.array([0.0, 0.0, 3.0]), atol=1e-12)
    rolled = Vessel(VesselParameters(departure_angle=0.0, departure_rotation=(0.2, 0.0, 0.0)))
    _, held = rolled.hang_off_pose(rolled.position(rolled.start()), rolled.start().quaternion)
    assert_allclose(rotation_matrix(held)[:, 1], [0.0, np.cos(0.2), np.sin(0.2)], atol=1e-15)


def test_rollback_repeats_the_step_bit_by_bit():
    """A state is a value: what follows from it, from its pickle, and after wild trial steps is the same to the last bit."""
    parameters = replace(PARAMETERS, controller=Controller(start=0.2, period=0.3), hold_force=(3e5, 0.0, 0.0))
    vessel = Vessel(parameters)
    rng = np.random.default_rng(11)
    state, time, h = vessel.start(), 0.0, 0.1
    for _ in range(30):
        inputs = Inputs(force=np.array([-3e5, 0.0, 9e5]) + 1e5 * rng.normal(size=3))
        saved, before = pickle.dumps(state), bits(state)
        first = vessel.step(state, time, h, inputs)
        vessel.step(state, time, 0.7 * h, random_inputs(rng))
        vessel.step(first.state, time + h, h, random_inputs(rng))
        assert bits(state) == before
        again = vessel.step(pickle.loads(saved), time, h, inputs)
        assert bits(again.state) == bits(first.state)
        state, time = first.state, time + h


def test_unsolvable_step_is_a_result_with_the_old_state():
    vessel = Vessel(PARAMETERS)
    state = vessel.start()
    result = vessel.step(state, 0.0, 0.1, Inputs(force=np.array([np.nan, 0.0, 0.0])))
    assert not result.converged
    assert result.state is state
    with pytest.raises(ValueError, match=r"h = 0.0: must be > 0 s"):
        vessel.step(state, 0.0, 0.0, Inputs())


def test_a_controller_outside_accelerates_the_vessel_by_its_force():
    """From rest, over a short step: M v / h is the force; surge and sway in b, and the yaw moment."""
    vessel = Vessel(replace(PARAMETERS, hold_force=(0.0, 0.0, 0.0), hang_off=(0.0, 0.0, 0.0), environment=Environment()))
    force = np.array([2e5, -1e5, 3e6])
    at_rest = vessel.start()._replace(position=np.zeros(3), quaternion=exp_quaternion(np.array([0.0, 0.0, 1.0]), 0.7))
    state = vessel.step(at_rest, 0.0, 1e-3, Inputs(control_force=force)).state
    got = vessel.hull.mass @ state.body_velocity / 1e-3
    assert_allclose(got[[0, 1, 5]], force, rtol=1e-4)


def test_the_potential_of_a_hold_thrust_is_minus_its_work_along_any_way():
    vessel, rng = Vessel(replace(PARAMETERS, hold_force=(3e5, -1e5, 4e6))), np.random.default_rng(8)
    start = vessel.start()
    moved = rng.normal(size=3)
    energy_there = vessel.hold_energy(start._replace(position=start.position + moved))
    assert vessel.hold_energy(start) == 0.0
    assert energy_there == pytest.approx(-(3e5 * moved[0] - 1e5 * moved[1]), rel=1e-9)
