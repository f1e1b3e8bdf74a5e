"""Theorems of the coupling, on a spring (with or without a mass of its own) tied to a body, both FMUs, through FMPy."""

from dataclasses import replace

import numpy as np
import pytest
from units.toys import build_pair, tied

from master.coupling.bond import Bond, Pair
from master.coupling.choose import coupling
from master.coupling.end import impedance_end, mobility_end
from master.coupling.energy_consistent import LEAST, EnergyConsistent
from master.coupling.hang_off import hang_off
from master.coupling.linearly_implicit import History, LinearlyImplicit
from master.coupling.predictor import Extrapolation
from master.coupling.scheme import CouplingFailed, Step
from master.fmu.errors import STEP_FAILURES

PUSH = {"start_velocity": [1.0, 0.5, 0.0], "start_rotation": [0.0, 0.2, -0.1]}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIPELAY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield build_pair(tmp_path_factory.mktemp("fmus"), failure={"above": 1e9})


def energy(pair) -> float:
    stored = pair.spring.get(("kinetic_energy", "elastic_energy")).sum()
    return float(stored + pair.body.get(("kinetic_energy", "restoring_energy")).sum())


@pytest.mark.parametrize("by_port", [True, False])
@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("hardening", [0.0, 100.0])
def test_the_bond_makes_no_energy_at_any_mass_ratio(files, mass, hardening, by_port):
    # Z Y = (2 m / H + ..) (H / 2 M) exceeds 1 for the light body: fixed-point iteration would diverge there
    spring = {"hardening": hardening, "inertia": 1.0, "damping": 0.05}
    body = {"mass": mass, "inertia": mass, "damping": 0.1, "load": [0.3, 0.0, 0.0], **PUSH}
    with tied(files, spring, body, 0.1, by_port=by_port, tolerance=1e-13) as pair:
        pair.run(0.1, 5.0)
        ledger, counters = pair.ledger, pair.coupling.counters
        assert ledger.interface_residual <= 1e-12 * ledger.exchanged
        assert ledger.largest_closure <= 1e-12 * ledger.exchanged
        assert counters.rejected_steps == 0
        assert ledger.exchanged > 0.0
        if hardening == 0.0 and by_port:
            assert np.median(counters.rounds) == 2


def test_round_off_in_the_length_of_a_step_costs_no_solve(files):
    solves = []
    for error in (0.0, 1e-13):
        with tied(files, {"hardening": 10.0}, {**PUSH, "mass": 50.0}, 0.1) as pair:
            for i in range(50):
                pair.coupling.advance(0.1 * i, 0.1 * (1.0 - error * (i % 2)))
            solves.append(pair.coupling.impedance.solves)
    assert solves[1] == solves[0]


def test_a_linear_step_costs_two_solves_of_the_impedance_end(files):
    with tied(files, {}, {"mass": 50.0, **PUSH}, 0.1) as pair:
        pair.run(0.1, 10.0)
        assert pair.coupling.impedance.solves <= 2 * pair.coupling.counters.steps + 1
        assert pair.coupling.mobility.solves <= 3 * pair.coupling.counters.steps + 1


def test_the_bond_leaves_no_kinematic_gap(files):
    with tied(files, {"hardening": 10.0}, PUSH, 0.1) as pair:
        pair.run(0.1, 5.0)
        np.testing.assert_allclose(pair.spring.get("stretch"), pair.body.get("position"), rtol=0, atol=1e-14)


@pytest.mark.parametrize("hardening", [0.0, 5.0])
def test_second_order_in_the_macro_step(files, hardening):
    # against x'' = -k x where it is linear, against H / 16 where it is not
    def end(step):
        with tied(files, {"hardening": hardening}, {**PUSH, "mass": 2.0}, step) as pair:
            pair.run(step, 2.0)
            return pair.state

    exact = end(0.1 / 16)
    if hardening == 0.0:
        w, v = np.sqrt([0.5] * 3 + [1.0] * 3), np.array([1.0, 0.5, 0.0, 0.0, 0.2, -0.1])
        exact = np.concatenate([v * np.sin(2.0 * w) / w, v * np.cos(2.0 * w)])
    coarse, fine = (np.linalg.norm(end(step) - exact) for step in (0.1, 0.05))
    assert 1.9 < np.log2(coarse / fine) < 2.1


@pytest.mark.parametrize(("step", "stable"), [(1.9, True), (2.1, False)])
def test_serial_exchange_of_end_values_is_stable_up_to_two(files, step, stable):
    with tied(files, {}, PUSH, step, scheme="serial", checked=False) as pair:
        pair.run(step, 200 * step)
        assert (np.abs(pair.spring.get("stretch")).max() < 100.0) == stable


def test_parallel_exchange_gains_energy_even_at_short_steps(files):
    with tied(files, {}, PUSH, 0.05, scheme="parallel", checked=False) as pair:
        before = energy(pair)
        pair.run(0.05, 100.0)
        assert energy(pair) > 3.0 * before


@pytest.mark.parametrize("step", [2.1, 1000.0])
def test_the_energy_consistent_step_is_stable_at_any_length(files, step):
    with tied(files, {}, PUSH, step) as pair:
        before = energy(pair)
        pair.run(step, 100 * step)
        assert energy(pair) == pytest.approx(before, rel=1e-9)
        assert pair.coupling.counters.rejected_steps == 0


def test_an_undamped_pair_keeps_its_energy_and_a_damped_one_loses_it(files):
    for damping in (0.0, 0.3):
        with tied(files, {"hardening": 100.0, "damping": damping}, PUSH, 0.2, tolerance=1e-13) as pair:
            energies = [energy(pair)]
            for i in range(50):
                pair.run_one(i * 0.2, 0.2)
                energies.append(energy(pair))
        change = np.diff(energies)
        assert (change <= 1e-12 * energies[0]).all()
        assert (change.sum() < -0.1 * energies[0]) == (damping > 0.0)


def test_a_discarded_step_is_halved_and_the_step_recovers(files):
    spring = {"failure.above": 0.03, "failure.start": 0.5, "failure.end": 1.0}
    with tied(files, spring, PUSH, 0.1) as pair, tied(files, {}, PUSH, 0.1) as reference:
        lengths = []
        time = 0.0
        while time < 2.0 - 1e-9:
            end = 0.1 * (np.floor(time / 0.1 + 1e-9) + 1)
            lengths.append((time, pair.coupling.advance(time, end - time).step))
            time += lengths[-1][1]
        reference.run(0.1, 2.0)
        assert pair.coupling.counters.rejected_steps >= 2
        assert max(step for start, step in lengths if 0.5 <= start < 1.0 - 1e-9) <= 0.03
        assert lengths[-1][1] == pytest.approx(0.1)
        assert pair.ledger.largest_closure <= 1e-10 * pair.ledger.exchanged
        np.testing.assert_allclose(pair.state, reference.state, atol=3e-3)  # two step lengths: truncation error only


@pytest.mark.parametrize(("scheme", "kind"), [("energy-consistent", "message"), ("serial", "arithmetic")])
def test_a_step_that_fails_at_every_length_ends_the_coupling_with_the_fmus_words(files, scheme, kind):
    spring = {"failure.above": 0.0, "failure.start": 0.5, "failure.kind": kind}
    with tied(files, spring, PUSH, 0.1, scheme=scheme, checked=False) as pair:
        with pytest.raises(CouplingFailed, match=r"coupling failed at 0.5 s .* spring: step .* planted") as caught:
            pair.run(0.1, 1.0)
        assert caught.value.time == pytest.approx(0.5)
        assert "\n" not in str(caught.value)
        assert (caught.value.step < 0.1 / 2000) == (scheme == "energy-consistent")


def test_a_bug_in_an_fmu_is_met_with_half_the_step_once(files):
    spring = {"failure.above": 0.0, "failure.kind": "bug"}
    with tied(files, spring, PUSH, 0.1) as pair:
        with pytest.raises(CouplingFailed, match=r"step of 0\.05 s at 0 s: RuntimeError: planted bug, 100 % certain"):
            pair.run(0.1, 1.0)
        assert pair.coupling.counters.rejected_steps == 2


def test_a_wrong_impedance_port_only_costs_rounds(files):
    # the port is believed at first; from the eighth round on difference quotients take over
    with tied(files, {"hardening": 1.0}, {"mass": 0.1, **PUSH}, 0.5) as pair:
        pair.coupling.impedance._sign = 3.0
        pair.run(0.5, 5.0)
        assert max(pair.coupling.counters.rounds) > 8
        assert pair.ledger.largest_closure <= 1e-9 * pair.ledger.exchanged


def test_a_rejected_step_leaves_no_trace(files):
    # the same steps, once with rejections before them
    states = []
    for refusals in (0, 3):
        left = [refusals]

        def check(step, left=left):
            left[0] -= 1
            return left[0] < 0

        with tied(files, {"hardening": 1.0}, PUSH, 0.1) as pair:
            pair.coupling.check = check
            pair.coupling.wanted = 0.1 / 2 ** (3 - refusals)
            pair.coupling.advance(0.0, 0.1)
            states.append((pair.state, pair.coupling.counters.rejected_steps))
    np.testing.assert_array_equal(states[0][0], states[1][0])
    assert (states[0][1], states[1][1]) == (0, 3)


def test_all_saved_states_are_freed(files):
    with tied(files, {"hardening": 100.0}, PUSH, 0.5) as pair:
        pair.run(0.5, 5.0)
        assert pair.spring._states == pair.body._states == set()


class Law:
    """An end that answers by a function of what it holds, from rest, and offers this slope."""

    rollback, yields, varies = True, False, True

    def __init__(self, answer, slope):
        self.answer, self.slope, self.solves = answer, slope, 0

    def solve(self, time, step, held):
        self.solves += 1
        return self.answer(held)

    def result(self):
        return np.zeros(2)

    def derivative(self):
        return self.slope

    def begin(self):
        pass

    commit = cancel = begin

    def meet(self, time, step, free, mobility):
        pass


def test_an_effort_that_does_no_work_is_agreed_on_all_the_same():
    """A gyroscope's is square to the flow: any gap in it has no residual, least of all with a slope that denies it."""
    turn, push = np.array([[0.0, -3.0], [3.0, 0.0]]), np.array([1.0, 0.5])
    spinning, body = Law(lambda flow: turn @ flow, np.zeros((2, 2))), Law(lambda effort: push + 0.7 * effort, 0.7 * np.eye(2))
    done = coupling("energy-consistent", spinning, body, Bond((Pair("f", "v", 1e-9, 2),)), 0.1, 1e-10).advance(0.0, 0.1)
    np.testing.assert_allclose(done.flow, np.linalg.solve(np.eye(2) - 0.7 * turn, push), rtol=1e-4)
    assert done.residual == pytest.approx(0.0, abs=1e-12)


def test_unknown_scheme_is_refused():
    with pytest.raises(ValueError, match="scheme = 'magic': must be one of energy-consistent, serial, parallel"):
        coupling("magic", None, None, hang_off(), 0.1)


def test_extrapolation_of_a_parabola_over_uneven_steps_is_exact():
    def value(time):
        return np.array([time**2, 1.0]), np.array([3.0, -(time**2)])

    guess = Extrapolation(*value(0.0), lambda errors: np.abs(errors).max(axis=1))
    for time in (0.1, 0.15, 0.4, 0.6, 0.7):
        guess.add(time, *value(time))
    np.testing.assert_allclose(np.concatenate(guess.at(1.0)), np.concatenate(value(1.0)), rtol=1e-12)


@pytest.mark.parametrize("step", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("spring", [{}, {"stiffness": 1e-3, "damping": 1.0}, {"inertia": 1.0}, {"inertia": 1.0, "damping": 0.3}])
def test_one_solve_each_without_rollback_does_not_grow_at_any_mass_ratio(files, spring, mass, step):
    body = {"mass": mass, "inertia": mass, "damping": 0.05, "stiffness": 0.1, "load": [0.3, 0.0, 0.0], **PUSH}
    with tied(files, spring, body, step, rollback=(False, False), action="warn") as pair:
        energies = []
        for i in range(300):
            pair.run_one(i * step, step)
            energies.append(energy(pair))
        assert pair.coupling.impedance.solves == pair.coupling.mobility.solves == 300
        assert max(energies[150:]) < 1.5 * max(energies[:150])
        assert max(energies) < 1e3
        np.testing.assert_allclose(pair.spring.get("stretch"), pair.body.get("position"), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("share", "believed"), [(0.5, 0.5), (1.9, 1.9), (5.0, 2.0), (-1.0, 0.0)])
def test_no_more_is_foreseen_of_an_end_than_a_passive_one_can_do(share, believed):
    """s_n = s_(n-1) - a Z V has 0 <= a <= 2 where the end makes no energy."""
    history, contribution, flow, weight = History(np.zeros(1), np.ones(1)), np.zeros(1), np.ones(1), 3.0 * np.eye(1)
    for _ in range(20):
        history.add(contribution, flow, weight)
        contribution = contribution - share * 3.0
    np.testing.assert_allclose(history.foreseen() - (contribution + share * 3.0), -believed * 3.0, rtol=1e-9, atol=1e-9)


def test_one_solve_each_leaves_a_residual_that_is_measured_and_falls_with_the_step(files):
    def left(step):
        with tied(files, {"hardening": 2.0}, {**PUSH, "damping": 0.1}, step, rollback=(False, False), action="warn") as pair:
            pair.run(step, 10.0)
            ledger = pair.ledger
            assert abs(ledger.closure) == pytest.approx(abs(pair.spring.get("top_work")[0] + pair.body.get("bond_work")[0]), rel=1e-9)
            return ledger.interface_residual / ledger.exchanged

    assert left(0.01) < left(0.05) / 5.0 < 1e-2


WAYS = {
    "iterated": {"tolerance": 1e-2},
    "one side": {"rollback": (True, False)},
    "one solve": {"rollback": (False, False)},
    "serial": {"scheme": "serial"},
    "parallel": {"scheme": "parallel"},
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_the_residual_of_a_step_is_that_of_what_the_units_report_whatever_the_scheme(files, way):
    with tied(files, {"damping": 0.2, "hardening": 30.0}, PUSH, 0.1, action="warn", **way) as pair:
        pair.coupling.check = lambda step, check=pair.ledger.check: check(step) or True
        time = 0.0
        for _ in range(40):
            done = pair.coupling.advance(time, 0.1)
            time += done.step
            assert done.residual == pytest.approx(pair.ledger.step_residual, rel=1e-9, abs=1e-15)
        leaves = way.get("rollback") != (True, False)  # of one side the pipe is solved again, until nothing is left
        assert (pair.ledger.interface_residual > 1e-9 * pair.ledger.exchanged) == leaves


class Failing:
    """An FMU whose answers are NaN, or which is in error, from a time on for steps above a length."""

    def __init__(self, fmu, kind, above):
        self._fmu, self._kind, self._above, self._bad, self.tries = fmu, kind, above, False, []

    def __getattr__(self, name):
        return getattr(self._fmu, name)

    def step(self, time, step, final=False):
        self._fmu.step(time, step, final)
        self._bad = time >= 0.5 - 1e-9 and step > self._above
        if self._bad:
            self.tries.append(step)
            if self._kind == "error":
                raise STEP_FAILURES[3]("spring: step: broken")

    def restore(self, state):
        self._bad = False
        self._fmu.restore(state)

    def get(self, names):
        return self._fmu.get(names) * (np.nan if self._bad and names == ("force", "moment") else 1.0)


@pytest.mark.parametrize("kind", ["nan", "error"])
def test_an_error_or_a_number_that_is_none_is_rolled_back_and_tried_once_more_with_half_the_step(files, kind):
    for above, cured in ((0.06, True), (0.0, False)):
        with tied(files, {}, PUSH, 0.1) as pair, tied(files, {}, PUSH, 0.1) as sound:
            pair.coupling.impedance.fmu = failing = Failing(pair.spring, kind, above)
            sound.run(0.1, 0.5)
            pair.run(0.1, 0.5)
            if cured:
                pair.run_one(0.5, 0.1)
                assert failing.tries[0] == pytest.approx(0.1)
                assert pair.coupling.counters.steps == 7
                continue
            with pytest.raises(CouplingFailed, match="not finite" if kind == "nan" else "broken") as caught:
                pair.run_one(0.5, 0.1)
            assert caught.value.time == pytest.approx(0.5)
            np.testing.assert_allclose(failing.tries, [0.1, 0.05])
            np.testing.assert_array_equal(pair.state, sound.state)  # both stand where they stood before
            assert pair.spring._states == pair.body._states == set()


def test_directional_derivatives_serve_where_there_is_no_port(files):
    with tied(files, {"hardening": 10.0}, PUSH, 0.1, by_port=False) as pair, tied(files, {"hardening": 10.0}, PUSH, 0.1) as port:
        calls = []

        def derivatives(results, held):
            calls.append((results, held))
            return -pair.spring.get("impedance").reshape(6, 6)

        pair.spring.has_derivatives, pair.spring.derivatives = True, derivatives
        pair.run(0.1, 2.0)
        port.run(0.1, 2.0)
        assert set(calls) == {(("force", "moment"), ("velocity", "angular_velocity"))}
        assert pair.coupling.impedance.solves == port.coupling.impedance.solves
        np.testing.assert_allclose(pair.state, port.state, rtol=1e-9)


def test_a_reversed_effort_port_is_turned_round(files):
    bond = Bond(tuple(replace(pair, reverse=True) for pair in hang_off().pairs))
    wrong, right = {"gain": -1.0, "hardening": 1.0}, {"hardening": 1.0}
    with tied(files, wrong, PUSH, 0.1, checked=False) as pair, tied(files, right, PUSH, 0.1) as good:
        ends = impedance_end(pair.spring, bond), mobility_end(pair.body, bond)
        pair.coupling = coupling("energy-consistent", *ends, bond, 0.1)
        pair.run(0.1, 3.0)
        good.run(0.1, 3.0)
        np.testing.assert_allclose(pair.state, good.state, rtol=1e-8, atol=1e-12)


class Still:
    """An end that stands."""

    rollback, yields, varies, solves = True, False, True, 0

    def result(self):
        return np.zeros(2)


def test_a_residual_is_measured_by_the_kinetic_energy_of_the_moved_end_up_to_the_mean_exchange():
    """m v^2 / 2, where the pull stands across the motion and does no work."""
    bond = Bond((Pair("effort", "flow", 1e-6, 2),))
    scheme, step, mass = EnergyConsistent(Still(), Still(), bond, 0.1), 0.1, np.array([3.0, 5.0])
    scheme._set_mobility(np.diag(step / 2.0 / mass))
    across = Step(0.0, step, np.array([2.0, 0.0]), np.array([0.0, 7.0]), 0.0, 1)
    assert scheme._energy_scale(across) == pytest.approx(step * 7.0 * 1e-6)  # nothing exchanged so far: only what counts as rest
    for exchanged, expected in ((100.0, 0.5 * 3.0 * 2.0**2), (2.0, 2.0)):
        scheme._exchanged = exchanged
        assert scheme._energy_scale(across) == pytest.approx(expected, rel=LEAST)


class Linear(Still):
    """An end that answers in proportion, and tells no slope."""

    def __init__(self, factor, offset):
        self.factor, self.offset = factor, np.array(offset)

    def result(self):
        return self.offset

    def solve(self, time, step, held):
        return self.factor * held + self.offset

    def derivative(self):
        return None


def test_what_one_solve_of_each_end_leaves_is_what_is_held_less_what_is_answered_times_the_flow():
    scheme = LinearlyImplicit(Linear(-2.0, [3.0, 1.0]), Linear(0.5, [0.2, 0.0]), Bond((Pair("effort", "flow", 1e-6, 2),)), 0.1)
    done = scheme.advance(0.0, 0.1)
    held, flow = np.array([3.0, 1.0]), np.array([1.7, 0.5])
    np.testing.assert_allclose(done.flow, flow)
    np.testing.assert_allclose(done.effort, [-0.4, 0.0], atol=1e-15)
    assert done.residual == pytest.approx(0.1 * float((held - done.effort) @ flow))
