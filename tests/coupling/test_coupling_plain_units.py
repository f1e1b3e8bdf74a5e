"""The pipe tied to units as users write them, without rollback, derivatives or energies: what the bond makes, and false claims."""

import io
from pathlib import Path

import numpy as np
import pytest
import units
from pythonfmu.builder import FmuBuilder
from units.toys import BODY

from master.__main__ import main
from master.coupling.bond import Bond, Pair
from master.coupling.mobility_law import MeasuredLaw
from master.errors import UsageError
from master.fmi.build import build_fmu
from master.fmu.instance import Fmu
from master.run.prepared import prepare
from master.run.simulate import simulate
from master.run.two_fmu_drive import open_bonded
from master.scene.reading import load

SCRIPT = Path(units.__file__).parent / "plain_mass.py"
SCENE = """
[simulation]
duration = 15.0
macro_step = 0.1
[units.pipe]
fmu = "{pipe}"
outputs = ["top_position"]
[units.mass]
fmu = "PlainMass.fmu"
outputs = ["position"]
[bond]
impedance = "pipe"
mobility = "mass"
pairs = [{{effort = "force", flow = "velocity", floor = 1e-6}}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("plain")
    changes = ["pipe.nodes=12", "simulation.recording_step=100", "simulation.snapshots=[]", "environment.current.ramp=2"]
    pipe = prepare(load("paper", changes))["pipe"]
    FmuBuilder.build_FMU(SCRIPT, dest=place)
    (place / "claiming").mkdir()
    FmuBuilder.build_FMU(SCRIPT, dest=place / "claiming", canGetAndSetFMUstate=True)
    build_fmu(BODY, place / "body.fmu")
    (place / "tied.toml").write_text(SCENE.format(pipe=pipe))
    return place


def ran(folder, out, *changes):
    """The summary and the recorded columns of the run, which must pass the energy check as it is."""
    result = simulate(load(str(folder / "tied.toml"), list(changes)), out, io.StringIO())
    assert result.passed, result.screen
    header = (out / "signals.csv").read_text().partition("\n")[0].split(",")
    values = np.loadtxt(out / "signals.csv", delimiter=",", skiprows=1)
    return result, dict(zip((name.partition(" [")[0] for name in header), values.T, strict=True))


@pytest.mark.parametrize("parts", [1, 3, 10])
def test_a_plain_mass_on_the_pipe_is_stepped_without_making_energy(folder, tmp_path, parts):
    """Before, the bond made eight times what it exchanged, and the run broke down; now a thousand-millionth."""
    result, found = ran(folder, tmp_path, f"units.mass.parameters={{parts={parts}.0, push=5e5}}")
    made = result.summary["interface_residual_J"] / result.summary["exchanged_energy_J"]
    assert result.summary["exchanged_energy_J"] > 1e5
    assert made <= 2e-9
    assert result.summary["interface_residual_percent"] == pytest.approx(100.0 * made)
    moved = found["pipe.top_position[3]"] - found["pipe.top_position[3]"][0] - found["mass.position[3]"]
    assert np.abs(moved).max() <= 2e-3 * np.abs(found["mass.position[3]"]).max()
    assert f"({100.0 * made:.2g} %)" in result.screen
    assert "a gap is left (largest: velocity x s " in result.screen


def test_it_moves_as_one_that_is_iterated_with_rollback(folder, tmp_path):
    """A released mass, against a body that rolls back and tells its mobility, on the same pipe."""
    files = load(str(folder / "tied.toml")).sections.units
    with Fmu(files["pipe"].fmu, "pipe") as pipe:
        pipe.initialize()
        pull = pipe.get("force").tolist()
    _, plain = ran(folder, tmp_path / "plain", "units.mass.parameters={parts=100.0, start=0.3}")
    balance = f"load={[-one for one in pull]}"
    body = f"units.mass.parameters={{mass=6e6, stiffness=1e6, damping=5e5, start_velocity=[0.0, 0.0, 0.3], {balance}}}"
    result, exact = ran(folder, tmp_path / "body", "units.mass.fmu='body.fmu'", body)
    assert "iterated with rollback" in result.screen
    times = exact["time"][::10]
    for i in (1, 3):
        expected = np.interp(times, exact["time"], exact[f"mass.position[{i}]"])
        np.testing.assert_allclose(np.interp(times, plain["time"], plain[f"mass.position[{i}]"]), expected, atol=2e-3 * 0.5)


def test_a_pair_at_rest_stays_within_the_floor_of_the_energy_check(folder, tmp_path):
    result, found = ran(folder, tmp_path, "simulation.duration=2.0")
    assert np.abs(found["mass.position[3]"]).max() <= 1e-9
    assert result.summary["energy_check_passed"]


def test_a_unit_that_claims_rollback_and_does_not_restore_is_named_at_the_start(folder, tmp_path, capsys):
    scene = load(str(folder / "tied.toml"), ["units.mass.fmu='claiming/PlainMass.fmu'"])
    with pytest.raises(UsageError, match="unit mass claims to restore a saved state and does not"), open_bonded(scene.sections):
        pass
    code = main(["run", str(folder / "tied.toml"), "--set=units.mass.fmu='claiming/PlainMass.fmu'", "-o", str(tmp_path / "out")])
    said = capsys.readouterr().err.splitlines()
    assert code == 2
    assert [line.startswith("pipelay: coupling.rollback = true: must be false") for line in said] == [True]


class Body:
    """A mass under half-explicit steps, `parts` of them in one, with a spring, a damper and a load; the mean flow it answers with."""

    def __init__(self, parts):
        self.parts, self.x, self.v = parts, np.zeros(2), np.zeros(2)
        self.inverse = np.array([[2.0, 0.5], [0.5, 1.0]])

    def answer(self, time, step, effort):
        before, h = self.x, step / self.parts
        for k in range(self.parts):
            load = np.array([np.sin(time + k * h), 0.3])
            self.v = self.v + h * (self.inverse @ effort + load - 0.5 * self.x - 0.2 * self.v)
            self.x = self.x + h * self.v
        return (self.x - before) / step


@pytest.mark.parametrize("parts", [1, 2, 10])
def test_the_law_of_a_unit_is_found_from_its_answers(parts):
    """A = (1 + 1 / parts) / 2 of the inverse mass in a step of so many parts: a force held lifts the velocity linearly."""
    scale = Bond((Pair("f", "v", 1e-6, 2),)).flow_increments()
    law, body, random = MeasuredLaw(np.zeros(2), scale), Body(parts), np.random.default_rng(3)
    time = 0.0
    for i in range(80):
        held, h = random.normal(size=2), 0.02 if i % 7 else 0.01
        free, slope = law.at(time + h / 2, h)
        flow = body.answer(time, h, held)
        missed = np.abs(flow - free - slope @ held).max()
        law.add(time + h / 2, h, flow, held)
        time += h
    _, slope = law.at(time, 0.02)
    np.testing.assert_allclose(slope, 0.02 * (1 + 1 / parts) / 2 * body.inverse, rtol=0.05)
    assert missed <= 0.15 * np.abs(slope @ held).max()


def test_a_mass_under_a_load_quadratic_in_time_is_foreseen_exactly_over_uneven_midpoint_steps():
    law, random, inverse = MeasuredLaw(np.zeros(2), np.ones(2)), np.random.default_rng(6), np.array([[2.0, 0.5], [0.5, 1.0]])
    time, v, missed = 0.0, np.zeros(2), []
    for _ in range(40):
        held, h = random.normal(size=2), random.uniform(0.05, 0.15)
        free, slope = law.at(time + h / 2, h)
        pull = h / 2 * (inverse @ held + [1.0 + 0.1 * time, 0.2])  # the load of the step's start: g is linear between two steps
        flow, v = v + pull, v + 2.0 * pull
        missed.append(np.abs(flow - free - slope @ held).max())
        law.add(time + h / 2, h, flow, held)
        time += h
    np.testing.assert_allclose(law.at(time, 0.1)[1], 0.05 * inverse, rtol=0.01)
    assert np.median(missed[20:]) <= 2e-3


@pytest.mark.parametrize("law", ["nothing moves", "noise alone"])
def test_no_slope_is_found_where_efforts_explain_nothing(law):
    found, random = MeasuredLaw(np.zeros(2), np.ones(2)), np.random.default_rng(4)
    largest = []
    for i in range(40):
        flow = np.zeros(2) if law == "nothing moves" else random.normal(size=2)
        found.add(0.1 * i + 0.05, 0.1, flow, 1e3 * random.normal(size=2))
        largest.append(np.abs(found.at(0.1 * i + 0.15, 0.1)[1]).max() * 1e3)
    assert np.median(largest) <= 0.5
