"""The stability cases through their FMUs: published co-simulation cases, analytic limits, the pipe against bodies of any mass."""

import math

import numpy as np
import pytest

from master.fmi.cache import cache_folder
from master.studies.stability import bodies, limits, published, study
from master.studies.stability.units.body_fmu.slave import Body, BodyUnit
from master.studies.stability.units.linear_fmu.exact import transition
from master.studies.stability.units.linear_fmu.slave import Mass, MassUnit, Spring, SpringUnit
from master.studies.stability.units.manipulator_fmu import model


@pytest.fixture(scope="module")
def cache():
    return cache_folder("fmus")


def test_schuellers_oscillator_beats_the_published_implicit_scheme_at_every_step(cache):
    results = published.schueller(cache)
    assert all(result.holds for result in results)
    coarse, fine = results[1].error, results[2].error
    assert 1.9 < math.log(coarse / fine, 4.0) < 2.1


def test_the_lim_oscillator_keeps_its_energy(cache):
    system = published.LIM
    short = published.Oscillator(system.first, system.second, 1.0)
    run, serial = (published.oscillate(short, 1e-3, cache, scheme) for scheme in ("energy-consistent", "serial"))
    exact = short.exact(np.linspace(0.0, 1.0, len(run.positions)))
    assert run.drift <= 1e-9
    assert serial.drift > 1e-3
    assert np.abs(run.positions - exact).max() < 0.2 * np.abs(serial.positions - exact).max()


def test_the_quarter_car_is_below_the_published_cut_of_the_parallel_exchanges_error_and_its_ledger_closes(cache):
    results = published.quarter_car(cache)
    assert all(result.holds for result in results)
    assert all(result.closure <= 1e-12 for result in results)
    assert 1.9 < math.log10(results[1].error / results[0].error) < 2.1


def test_the_manipulator_reference_is_the_published_one_to_its_own_error():
    # published: 0.51536899 m by a first-order step of 0.05 ms; its steps of 0.1 ms and 0.05 ms differ by 1.4e-6 m
    assert model.actuator(model.ANGLES[0])[0] == pytest.approx(0.5, abs=1e-15)
    pressure, opening = model.equilibrium()
    np.testing.assert_allclose([*pressure / 1e6, opening], [3.1708462, 4.5291538, 0.45434559], rtol=1e-7)
    assert published.manipulator_reference()[10.0] == pytest.approx(0.51536899, abs=2e-6)


def test_the_manipulator_at_15_ms_stays_on_the_reference(cache):
    _, result = published.manipulator(cache, end=6.0)
    assert result.error < 1e-4
    assert result.closure <= 1e-9


def test_the_limits_are_those_of_theory(cache):
    assert [limit.holds for limit in limits.limits(cache)] == [True, True, True]


def test_the_map_has_the_serial_limit_of_a_mass_before_a_heavy_one():
    found = limits.stability_map(np.array([0.1, 1.95, 2.05, 1000.0]), np.array([1e6]))
    assert (found["serial"][0] > 1.0 + limits.GROWTH).tolist() == [False, False, True, True]
    assert (found["parallel"] > 1.0 + limits.GROWTH).all()
    assert (found["energy-consistent"] <= 1.0 + limits.GROWTH).all()


def test_an_exact_step_loses_what_its_damper_takes():
    # m v' = -c v: from v = 1 the loss is m (1 - exp(-2 c h / m)) / 2
    unit = MassUnit(Mass(mass=2.0, damping=3.0, start_velocity=1.0))
    unit.initialize(0.0, {})
    unit.step(0.0, 0.7, {"force": np.zeros(1)})
    assert unit.output("damping_dissipation")[0] == pytest.approx(1.0 - math.exp(-2.0 * 3.0 * 0.7 / 2.0), rel=1e-13)


@pytest.mark.parametrize("h", [0.01, 1.0, 50.0])
def test_both_halves_balance_their_energy_at_any_step(h):
    for unit, port in (
        (MassUnit(Mass(2.0, 5.0, 0.3, start_position=1.0)), "force"),
        (SpringUnit(Spring(2.0, 5.0, 0.3, 7.0, 0.4, start_position=1.0)), "velocity"),
    ):
        unit.initialize(0.0, {})

        def balance(unit=unit):
            names = ("kinetic_energy", "elastic_energy", "damping_dissipation")
            return sum(float(unit.output(name)[0]) for name in names) - float(unit.output("bond_work")[0])

        before = balance()
        unit.step(0.0, h, {port: np.array([0.8])})
        assert balance() == pytest.approx(before, rel=1e-10)


def test_the_transition_is_the_closed_form_of_an_undamped_mass():
    w, h = 3.0, 0.4
    found = transition(np.array([[0.0, 1.0], [-w * w, 0.0]]), np.array([0.0, 1.0]), np.zeros((3, 3)), h)
    c, s = math.cos(w * h), math.sin(w * h)
    np.testing.assert_allclose(found.end, [[c, s / w, (1 - c) / w**2], [-w * s, c, s / w]], atol=1e-14)
    np.testing.assert_allclose(found.integral[0], [s / w, (1 - c) / w**2, (h - s / w) / w**2], atol=1e-14)


@pytest.fixture(scope="module")
def rest(cache):
    return study.rest(cache)


HARDEST = [(mass, 1.0, bodies.DURATION) for mass in bodies.MASSES]  # the longest step: the most solves, and the steps that are cut
EXTREMES = [(mass, step, 8.0) for step in bodies.STEPS[:-1] for mass in (bodies.MASSES[0], bodies.MASSES[-1])]


@pytest.mark.parametrize(("mass", "step", "duration"), HARDEST + EXTREMES)
@pytest.mark.parametrize("state", bodies.STATES, ids=lambda state: state.name)
def test_the_pipe_against_a_body_of_any_mass(rest, mass, step, duration, state):
    found = bodies.run(bodies.Case("energy-consistent", mass, step, state, duration=duration), rest)
    assert found.finished
    assert found.residual <= 1e-6
    assert max(found.gap_m, found.gap_rad) <= 1e-9
    assert found.solves <= 2.0
    assert found.holds or duration < bodies.DURATION  # the pull is as the state says, over the whole


def test_serial_exchange_loses_a_light_body(rest):
    found = bodies.run(bodies.Case("serial", 1e2, 0.2, bodies.STATES[0]), rest)
    assert not found.finished
    assert found.end_s < 10.0


@pytest.mark.parametrize("mass", [1e2, 1e4, 1e6, 1e8])
def test_the_states_are_what_they_are_called(rest, mass):
    pull = {state.name: bodies.run(bodies.Case("energy-consistent", mass, 0.2, state, duration=24.0), rest) for state in bodies.STATES}
    still = float(np.linalg.norm(rest.pull[:3])) / 1e3
    assert pull["taut"].least_pull > 0.7 * still
    assert pull["slack"].least_pull < 0.15 * still
    assert pull["snapping"].least_pull < 0.15 * still
    assert pull["snapping"].largest_pull > 2.0 * still


def test_a_shaken_body_has_the_impulse_of_its_load_at_any_step_and_turns_by_its_angle():
    # m v' = f cos(w t): v = f sin(w t) / (m w), exactly at the end of every step; a constant spin turns by spin x time
    body = Body(mass=4.0, inertia=2.0, shaking_force=(3.0, 0.0, 0.0), period=7.0, start_rotation=(0.0, 0.6, 0.0))
    unit, still = BodyUnit(body), {"force": np.zeros(3), "moment": np.zeros(3)}
    unit.initialize(0.0, {})
    for i in range(5):
        unit.step(1.3 * i, 1.3, still)
    rate, end = 2.0 * math.pi / 7.0, 5 * 1.3
    np.testing.assert_allclose(unit.output("end_velocity"), [3.0 * math.sin(rate * end) / (4.0 * rate), 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(unit.output("quaternion"), [math.cos(0.3 * end), 0.0, math.sin(0.3 * end), 0.0], atol=1e-14)
    kinetic = unit.output("kinetic_energy")[0] - 0.5 * 2.0 * 0.6**2
    assert unit.output("environment_work")[0] == pytest.approx(kinetic, rel=1e-12)
