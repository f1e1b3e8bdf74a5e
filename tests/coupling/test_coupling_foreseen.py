"""The coupling of units of which one or neither can roll back: foreseen answers, what they leave, and how such a step fails."""

import numpy as np
import pytest
from units.toys import build_pair, tied

from master.coupling.bond import Bond, Pair
from master.coupling.one_sided import OneSided
from master.coupling.predicted_end import PredictedEnd
from master.coupling.scheme import CouplingFailed
from master.fmi.cache import cache_folder
from master.run.pipe_drive import open_drive, pose_gap
from master.run.prepared import prepare
from master.scene.reading import load
from master.studies.stability import bodies, study

PUSH = {"start_velocity": [1.0, 0.5, 0.0], "start_rotation": [0.0, 0.2, -0.1]}
ONE_SIDED = (True, False)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIPELAY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield build_pair(tmp_path_factory.mktemp("fmus"), failure={"above": 1e9})


@pytest.mark.parametrize("step", [0.1, 1.0])
@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("spring", [{}, {"inertia": 1.0}, {"hardening": 1.0, "damping": 0.1}], ids=["spring", "mass", "hardening"])
def test_a_body_that_cannot_roll_back_does_not_gain_energy_at_any_mass_ratio(files, spring, mass, step):
    body = {"mass": mass, "inertia": mass, "damping": 0.05 * mass, "load": [0.3, 0.0, 0.0], **PUSH}
    with tied(files, spring, body, step, rollback=ONE_SIDED, action="warn") as pair:
        assert isinstance(pair.coupling, OneSided)
        stored = []
        for i in range(200):
            pair.run_one(i * step, step)
            energies = pair.spring.get(("kinetic_energy", "elastic_energy")).sum() + pair.body.get("kinetic_energy")[0]
            stored.append(energies - pair.body.get("environment_work")[0])
        assert max(stored[100:]) <= 1.01 * max(stored[:100]) + 1e-9
        assert pair.coupling.mobility.solves == pair.coupling.counters.steps  # each step once


def test_the_residual_falls_faster_than_the_square_of_the_step(files):

    def left(step):
        with tied(files, {"hardening": 2.0}, {**PUSH, "damping": 0.1}, step, rollback=ONE_SIDED, action="warn") as pair:
            for i in range(round(10.0 / step)):
                pair.run_one(i * step, step)
                np.testing.assert_allclose(pair.spring.get("stretch"), pair.body.get("position"), atol=1e-4)
            return pair.ledger.interface_residual / pair.ledger.exchanged

    assert left(0.025) < left(0.1) / 4.0**2


def test_the_slope_of_an_end_without_one_is_measured(files):
    """A body that offers neither rollback nor derivative."""
    body = {"mass": 1.0, "inertia": 1.0, "damping": 0.05, **PUSH}
    with tied(files, {"stiffness": 100.0, "turning": 100.0}, body, 0.1, by_port=False, rollback=ONE_SIDED, action="warn") as pair:
        pair.run(0.1, 20.0)
        slope = pair.coupling.mobility.derivative()
        np.testing.assert_allclose(np.diag(slope)[:2], 0.1 / 2.0, rtol=0.1)
        assert abs(pair.ledger.closure) < 0.05 * pair.ledger.exchanged


class Body:
    """An end with this inverse of its mass, that offers neither rollback nor derivative."""

    rollback, yields, varies = False, False, True

    def __init__(self, inverse):
        self.inverse, self.velocity, self.solves = inverse, np.zeros(len(inverse)), 0

    def result(self):
        return self.velocity

    def solve(self, time, step, held):
        flow = self.velocity + step / 2 * self.inverse @ held
        self.velocity = 2 * flow - self.velocity
        return flow

    def derivative(self):
        return None


@pytest.mark.parametrize(
    ("inverse", "passive"),
    [
        ([[2.0, 0.5], [0.5, 1.0]], [[2.0, 0.5], [0.5, 1.0]]),
        ([[2.0, 0.0], [0.0, -1.0]], [[2.0, 0.0], [0.0, 0.0]]),
        ([[1.0, 0.7], [0.0, 1.0]], [[1.0, 0.35], [0.35, 1.0]]),
    ],
    ids=["a mass", "one that gives energy", "one without reciprocity"],
)
def test_the_measured_slope_is_symmetric_and_not_negative_whatever_the_end_does(inverse, passive):
    foreseen, random = PredictedEnd(Body(np.array(inverse)), Bond((Pair("f", "v", 1e-6, 2),))), np.random.default_rng(1)
    for i in range(60):
        held, step = random.normal(size=2), 0.1
        foreseen.take(i * step, step, held)
    foreseen.solve(60 * step, step, held)
    np.testing.assert_allclose(foreseen.derivative(), 0.1 / 2 * np.array(passive), atol=1e-4)


@pytest.mark.parametrize("rollback", [True, False])
def test_what_the_other_end_did_not_follow_it_is_told_to_make_up_for(rollback):
    ends = [Body(np.eye(2)) for _ in range(2)]
    expected = []
    for end, missed in zip(ends, (0.0, 0.25), strict=True):
        end.rollback = rollback
        foreseen, held = PredictedEnd(end, Bond((Pair("f", "v", 1e-6, 2),))), np.array([0.3, -0.2])
        foreseen.take(0.0, 0.1, held)
        foreseen.owe(np.full(2, 0.1 * missed), np.zeros(2))  # the end moved `missed` further than it was followed, for 0.1 s
        expected.append(foreseen.solve(0.1, 0.2, held))
    np.testing.assert_allclose(expected[1] - expected[0], 0.25 * 0.1 / 0.2, rtol=1e-12)


def test_what_the_other_end_pulled_beyond_what_was_held_is_held_in_the_next_step():
    foreseen, held = PredictedEnd(Body(np.eye(2)), Bond((Pair("f", "v", 1e-6, 2),))), np.array([0.3, -0.2])
    foreseen.owe(np.zeros(2), np.array([0.05, 0.02]))  # N s
    given, flow, wanted = foreseen.take(0.0, 0.1, held)
    np.testing.assert_allclose(given, held + np.array([0.5, 0.2]), atol=1e-15)
    np.testing.assert_allclose(flow, 0.05 * given, atol=1e-15)  # of a unit mass from rest
    np.testing.assert_array_equal(wanted, flow)
    foreseen.owe(np.array([0.03, -0.01]), -foreseen._impulse)  # m, and no impulse
    given, flow, wanted = foreseen.take(0.1, 0.1, held)
    np.testing.assert_allclose(given, held, atol=1e-15)
    np.testing.assert_allclose(wanted - flow, [0.3, -0.1], atol=1e-15)


def test_a_step_that_one_end_refuses_is_halved_while_the_other_stands_still_and_is_final_once_it_has_moved(files):
    refused = {"failure.above": 0.03, "failure.start": 1.0, "failure.end": 1.5}
    with tied(files, refused, PUSH, 0.1, rollback=ONE_SIDED, action="warn") as pair:
        pair.run(0.1, 2.0)
        assert pair.coupling.counters.rejected_steps >= 2
        assert pair.coupling.mobility.solves == pair.coupling.counters.steps
    with tied(files, {}, PUSH, 0.1, rollback=ONE_SIDED) as pair:
        pair.coupling.check = lambda step: False
        with pytest.raises(CouplingFailed, match="the check sent the step back, and an FMU cannot roll back"):
            pair.run(0.1, 0.1)


@pytest.fixture(scope="module")
def rest():
    return study.rest(cache_folder("fmus"))


@pytest.mark.parametrize("mass", [1e2, 1e8])
@pytest.mark.parametrize("state", bodies.STATES, ids=lambda state: state.name)
def test_the_pipe_and_a_body_neither_of_which_can_roll_back_are_solved_once_a_step(rest, mass, state):
    """What is foreseen wrongly stays small beside what happens: two thousandths of the energy exchanged, one of the motion."""
    found = bodies.run(bodies.Case("energy-consistent", mass, 0.05, state, duration=6.0, rollback=False), rest)
    assert found.finished
    assert found.solves == found.most_solves == 1
    assert found.residual <= 2e-3
    assert found.gap_m <= 1e-3 * state.excursion


def test_the_papers_scene_keeps_its_energy_with_one_solve_of_a_pipe_that_cannot_roll_back():
    changes = ["pipe.nodes=12", "simulation.recording_step=100", "simulation.snapshots=[]"]
    changes += ["environment.current.start=0", "environment.current.ramp=2"]
    scene = load("paper", [*changes, "coupling.rollback=false", "simulation.duration=8"])
    with open_drive(scene.sections, prepare(scene)) as drive:
        while drive.time < 8.0:
            drive.advance(8.0)  # the energy check would stop it
        assert drive.cost.pipe_solves == drive.cost.macro_steps
        assert drive.ledger.exchanged > 1.0
        assert pose_gap(drive.units["pipe"], drive.units["vessel"])["pose_gap", "m"] <= 1e-9
