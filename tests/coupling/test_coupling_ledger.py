"""The energy check: closes where the coupling is right, and sees what no FMU can see by itself."""

import numpy as np
import pytest
from units.toys import BODY_COLUMNS, SPRING_COLUMNS, build_pair, tied

from master.coupling.end import FmuEnd
from master.coupling.ledger import Columns, EnergyCheckFailed, Ledger
from master.coupling.scheme import Step
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu

PUSH = {"start_velocity": [1.0, 0.5, 0.0]}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIPELAY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield build_pair(tmp_path_factory.mktemp("fmus"))


def test_totals_are_those_of_the_fmus_own_reports(files):
    body = {"load": [1.0, 0.0, 0.0], "damping": 0.2, "stiffness": 0.5, **PUSH}
    with tied(files, {"damping": 0.1, "hardening": 3.0}, body, 0.1, tolerance=1e-12) as pair:
        moved = []
        for i in range(50):
            before = pair.spring.get("top_work")[0]
            pair.run_one(0.1 * i, 0.1)
            moved.append(abs(pair.spring.get("top_work")[0] - before))
        ledger = pair.ledger
        row = dict(zip(ledger.names, ledger.row, strict=True))
        assert ledger.exchanged == pytest.approx(sum(moved), rel=1e-12)
        assert row["spring.top_work"] == pair.spring.get("top_work")[0]
        assert row["body.environment_work"] == pair.body.get("environment_work")[0]
        assert row["closure"] == ledger.closure
        assert ledger.summary()["ledger_closure_J"] == ledger.largest_closure <= 1e-12 * ledger.exchanged
        assert ledger.verdict().startswith("energy check passed: largest closure error")


@pytest.mark.parametrize("mistake", [{"gain": -1.0}, {"gain": 0.999}, {"swap": True}])
@pytest.mark.parametrize(("stiffness", "mass"), [(1.0, 0.1), (1.0, 1000.0), (1e4, 0.1)])
@pytest.mark.parametrize("by_port", [True, False])
def test_a_wrong_sign_gain_or_axis_of_the_force_port_fails_loudly(files, mistake, stiffness, mass, by_port):
    # each FMU balances itself, and the coupling agrees on the ports: only the sum shows it
    spring = {"stiffness": stiffness, **mistake}
    with tied(files, spring, {"mass": mass, **PUSH}, 0.1, by_port=by_port) as pair:
        with pytest.raises(EnergyCheckFailed, match=r"^energy check failed at 0.1 s: closure error .* the bond made") as caught:
            pair.run(0.1, 1.0)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("held", [(("moment", "force"), None), (("force", "moment"), "y")])
def test_a_wrong_connection_of_right_fmus_fails_loudly(files, held):
    class Crossed(FmuEnd):
        def result(self):
            return np.roll(super().result(), 1)

        def solve(self, time, step, values):
            return np.roll(super().solve(time, step, values), 1)

    with tied(files, {"turning": 2.0}, {**PUSH, "mass": 3.0}, 0.1, by_port=False) as pair:
        names, axis = held
        if axis:
            pair.coupling.impedance = Crossed(pair.spring, pair.coupling.bond.flows, names)
        else:
            pair.coupling.mobility = FmuEnd(pair.body, names, pair.coupling.bond.flows)
        with pytest.raises(EnergyCheckFailed, match="energy check failed"):
            pair.run(0.1, 1.0)


def test_warn_goes_on_and_keeps_the_first_complaint(files):
    with tied(files, {"gain": -1.0}, {"mass": 100.0, **PUSH}, 0.1, action="warn") as pair:
        pair.run(0.1, 1.0)
        assert pair.coupling.counters.steps == 10
        assert pair.ledger.complaint.startswith("energy check failed at 0.1 s")
        assert pair.ledger.verdict().startswith("energy check failed: largest closure error")


def test_refine_halves_a_step_whose_residual_the_coupling_let_pass(files):
    # a sloppy coupling tolerance: shorter steps make smaller residuals
    runs = {}
    for action in ("warn", "refine"):
        with tied(files, {"hardening": 30.0}, PUSH, 0.2, action=action, tolerance=1e-3) as pair:
            pair.ledger.tolerance = 1e-6
            pair.run(0.2, 2.0)
            runs[action] = (pair.ledger.largest_closure / pair.ledger.exchanged, pair.coupling.counters.rejected_steps)
    assert runs["warn"][0] > 1e-6
    assert runs["refine"][0] <= 1e-6
    assert runs["refine"][1] > 0


def test_residuals_that_cancel_do_not_hide_each_other():
    def step(moved, residual):
        return Step(0.0, 1.0, np.array([moved]), np.array([1.0]), residual, 1)

    ledger = Ledger([], tolerance=1e-3)
    assert all(ledger.check(step(*done)) for done in ((10.0, 0.0), (0.1, 4e-3), (0.1, -4e-3)))
    with pytest.raises(EnergyCheckFailed, match=r"closure error 0\.004 J .* the bond made 0\.004 J in this step, 0\.012 J in all"):
        ledger.check(step(0.1, 4e-3))


def test_refine_gives_up_on_what_no_step_can_cure(files):
    with tied(files, {"gain": -1.0}, PUSH, 0.1, action="refine") as pair, pytest.raises(EnergyCheckFailed):
        pair.run(0.1, 1.0)


def test_the_message_names_the_fmu_that_does_not_balance_itself(files):
    forgetful = Columns(BODY_COLUMNS.energy, (), BODY_COLUMNS.dissipation, BODY_COLUMNS.bond)  # without its load's work
    with tied(files, {}, {"load": [1.0, 0.0, 0.0]}, 0.1) as pair:
        pair.coupling.check = Ledger([(pair.spring, SPRING_COLUMNS), (pair.body, forgetful)]).check
        with pytest.raises(EnergyCheckFailed) as caught:
            pair.run(0.1, 1.0)
    text = str(caught.value)
    assert abs(float(text.split("spring's own balance is off by ")[1].split()[0])) < 1e-12
    assert abs(float(text.split("body's own balance is off by ")[1].split()[0])) > 1e-4


def test_energy_that_vanishes_fails_as_well_as_energy_that_appears(files):
    silent = Columns(BODY_COLUMNS.energy, BODY_COLUMNS.work, (), BODY_COLUMNS.bond)  # without what its damper takes
    with tied(files, {}, {"damping": 0.5, **PUSH}, 0.1) as pair:
        sources = [(pair.spring, SPRING_COLUMNS), (pair.body, silent)]
        strict, patient = Ledger(sources), Ledger(sources, action="warn")
        pair.coupling.check = patient.check
        pair.run(0.1, 1.0)
        assert patient.largest_closure == pytest.approx(pair.body.get("damping_dissipation")[0], rel=1e-9)
        with pytest.raises(EnergyCheckFailed, match="closure error -"):
            strict.record(1.0)


def test_one_fmu_alone_is_balanced_with_its_bond_as_work_from_outside(files):
    with Fmu(files[0], "spring") as spring:
        spring.initialize({"damping": 0.1})
        ledger = Ledger([(spring, Columns(SPRING_COLUMNS.energy, ("top_work",), SPRING_COLUMNS.dissipation))])
        for i in range(20):
            spring.set("velocity", [np.sin(i), 0.0, 0.0])
            spring.step(0.1 * i, 0.1)
            assert ledger.record(0.1 * (i + 1))
        assert ledger.exchanged > 0.0
        assert ledger.largest_closure <= 1e-13 * ledger.exchanged
        assert ledger.interface_residual == 0.0


def test_a_missing_bond_column_is_refused(files):
    with Fmu(files[0], "spring") as spring:
        spring.initialize()
        with pytest.raises(FmuFailed, match="spring: has no port 'bond_work'"):
            Ledger([(spring, Columns(bond="bond_work"))])


def test_what_is_allowed_is_said_with_its_floor(files):
    with tied(files, {"gain": -1.0}, {"mass": 100.0, **PUSH}, 0.1, action="warn") as pair:
        floor = pair.ledger.allowed
        assert floor == pytest.approx(1e-12 * pair.ledger.largest)
        assert floor > 0.0
        pair.run(0.1, 1.0)
        ledger = pair.ledger
        assert ledger.allowed == pytest.approx(ledger.tolerance * ledger.exchanged + 1e-12 * ledger.largest)
        assert ledger.summary()["energy_check_allowed_J"] == ledger.allowed == ledger.row[ledger.names.index("allowed")]
        assert f"at the end {ledger.allowed:.2g} J allowed" in ledger.verdict()
        assert "; first failed at 0.1 s" in ledger.verdict()


def test_the_largest_closure_error_is_kept_where_later_ones_are_smaller():
    ledger = Ledger([], tolerance=1e-3)
    for residual, closure in ((4e-3, 4e-3), (-3e-3, 1e-3), (-2e-3, -1e-3)):
        assert ledger.check(Step(0.0, 1.0, np.array([20.0]), np.array([1.0]), residual, 1))
        assert ledger.closure == pytest.approx(closure)
    assert ledger.largest_closure == pytest.approx(4e-3)
    assert ledger.summary()["interface_residual_J"] == pytest.approx(9e-3)


def test_short_first_steps_at_rest_are_held_to_what_counts_as_rest_in_a_macro_step():
    """A pull of 1 MN at a flow floor of 1e-6 m/s and a macro step of 0.1 s: 0.1 J, of which the check allows a hundred-millionth."""
    step = Step(0.0, 1e-4, np.zeros(1), np.array([1e6]), 3e-12, 1)
    assert Ledger([], idle=lambda effort: 1e-6 * float(np.abs(effort).sum()), rest=0.1).check(step)
    with pytest.raises(EnergyCheckFailed, match="closure error"):
        Ledger([], idle=lambda effort: 1e-6 * float(np.abs(effort).sum())).check(step)


def test_products_of_effort_and_flow_that_cancel_leave_their_round_off():
    across = Step(0.0, 1.0, np.array([1.0, 1.0]), np.array([1e6, -1e6]), 1e-7, 1)
    assert Ledger([], tolerance=1e-8).check(across)
