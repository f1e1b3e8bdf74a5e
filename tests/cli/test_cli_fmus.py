"""Short runs through real FMUs: passivity, loads from a table, a prescribed top, and sabotage that must not go unseen."""

import json
import re
import time
import zipfile

import numpy as np
import pytest

from master import commands
from master.__main__ import main
from master.coupling.end import FmuEnd, mobility_end
from master.coupling.ledger import EnergyCheckFailed
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu
from master.run import pipe_drive
from master.run.pipe_drive import open_drive
from master.run.prepared import prepare
from master.scene import reading

EXPORTED = (
    "pipe.fmu", "vessel.fmu", "system.ssp", "OspSystemStructure.xml", "OspSystemStructure_ecco.xml", "Pipe_OspModelDescription.xml",
    "Vessel_OspModelDescription.xml",
)  # fmt: skip
ROUND_OFF = 1e-12  # of the largest term of the energy
BUSY = ["environment.current.start=0", "environment.current.ramp=4", "vessel.controller.start=2", "simulation.snapshots=[]"]


def marched(name, changes, macro_step, duration):
    """Rows of the ledger (steps + 1, columns) by name, after a run of `duration`."""
    loaded = reading.load(name, [*changes, f"simulation.duration={duration}", f"simulation.macro_step={macro_step}",
                               f"simulation.recording_step={duration}"])  # fmt: skip
    with open_drive(loaded.sections, prepare(loaded)) as moving:
        rows = [moving.ledger.row]
        while moving.time < duration:
            moving.advance(duration)
            rows.append(moving.ledger.row)
        return dict(zip(moving.ledger.names, np.array(rows).T, strict=True))


def total(rows, *endings):
    return sum(values for name, values in rows.items() if name.endswith(endings))


@pytest.mark.parametrize("macro_step", [0.05, 0.2, 1.0])
@pytest.mark.parametrize(("name", "changes"), [("free-decay", []), ("paper", BUSY)], ids=["free decay", "current, control"])
def test_energy_less_what_is_supplied_never_rises(name, changes, macro_step):
    """Eqs. (80), (87), (89), (90): E' <= supplied power, in every step of any length."""
    rows = marched(name, changes, macro_step, 10.0)
    works = total(rows, "current_work", "control_work", "environment_work")
    energy = total(rows, "_energy")
    largest = max(np.abs(values).max() for values in rows.values())
    assert np.diff(energy - works).max() <= ROUND_OFF * largest
    assert total(rows, "_dissipation")[-1] > 1e3
    if name == "free-decay":
        assert rows["pipe.current_work"][-1] == rows["vessel.current_work"][-1] == 0.0


class Sabotaged(FmuEnd):
    """A connection to the vessel that reverses the force, or turns its axes round."""

    def solve(self, time, step, held):
        return super().solve(time, step, self.wrong(held))


WRONG = {
    "reversed": lambda held: -held,
    "force reversed": lambda held: held * [-1, -1, -1, 1, 1, 1],
    "axes exchanged": lambda held: held[[1, 0, 2, 3, 4, 5]],
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_wrong_connection_fails_the_energy_check_with_exit_code_1(monkeypatch, tmp_path, capsys, wrong):
    def connect(fmu, bond):
        good = mobility_end(fmu, bond)
        good.__class__, good.wrong = Sabotaged, wrong
        return good

    monkeypatch.setattr(pipe_drive, "mobility_end", connect)
    changes = [f"--set={change}" for change in ("simulation.duration=5", "simulation.recording_step=1", *BUSY)]
    assert main(["run", *changes, "-o", str(tmp_path)]) == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "stopped"
    assert not summary["energy_check_passed"]
    assert re.search(r"energy check +failed at", capsys.readouterr().out)


def test_a_load_from_a_table_does_the_work_that_it_gives(tmp_path):
    push = "tables.environment=[{time=0}, {time=1, force=[0, 2e5, 0]}, {time=9, force=[0, 2e5, 0]}]"
    rows = marched("free-decay", [push], 0.1, 4.0)
    assert rows["vessel.environment_work"][-1] > 1e3
    assert abs(rows["closure"]).max() <= 1e-8 * rows["exchanged"][-1]


def test_a_prescribed_top_goes_exactly_where_it_should():
    loaded = reading.load("heave", ["simulation.duration=4", "simulation.recording_step=4", "top_motion.ramp=0"])
    with open_drive(loaded.sections, prepare(loaded)) as moving:
        while moving.time < 4.0:
            moving.advance(4.0)
        position = moving.units["pipe"].get("top_position")
        motion = loaded.sections.top_motion
        np.testing.assert_allclose(position, np.add(motion.displacement(4.0), (800.0, 0.0, -800.0)), atol=1e-11)
        assert moving.ledger.largest_closure <= 1e-8 * moving.ledger.exchanged
        assert moving.cost.pipe_solves == moving.cost.macro_steps == 40


def test_a_prescribed_top_is_watched_too():
    """A pipe that reports half the work done on it does not go unseen."""
    loaded = reading.load("heave", ["simulation.duration=4", "simulation.recording_step=4"])
    with open_drive(loaded.sections, prepare(loaded)) as moving:
        pipe = moving.units["pipe"]
        honest = pipe.get

        def get(names):
            values = honest(names)
            if "top_work" in names:
                values[names.index("top_work")] *= 0.5
            return values

        pipe.get = get
        with pytest.raises(EnergyCheckFailed, match="energy check failed"):
            moving.advance(4.0)


def test_a_bad_value_in_a_units_table_is_a_mistake_of_the_user(capsys, tmp_path):
    assert main(["run", "--set", "pipe.section.outer_diameter=-0.4", "-o", str(tmp_path / "out")]) == 2
    assert "pipe.section.outer_diameter = -0.4: must be > 0 m" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_export_writes_fmus_that_start_in_the_equilibrium(tmp_path, capsys):
    assert main(["export", "-o", str(tmp_path)]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / name) for name in EXPORTED]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(EXPORTED)
    loaded = reading.load("paper")
    exported = {name: tmp_path / f"{name}.fmu" for name in ("pipe", "vessel")}
    with open_drive(loaded.sections, exported) as moving:
        gap = pipe_drive.pose_gap(moving.units["pipe"], moving.units["vessel"])
        assert max(gap.values()) < 1e-9


def test_an_export_leaves_nothing_of_another_scenes_and_an_interrupted_one_nothing_of_its_own(tmp_path, monkeypatch, capsys):
    for name in (*EXPORTED, "mine.fmu"):
        (tmp_path / name).write_text("old")

    def interrupted(fmus, folder, *_):
        assert all(path.parent == folder and path.is_file() for path in fmus.values())
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(commands, "write_system", interrupted)
        assert main(["export", "-o", str(tmp_path)]) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*EXPORTED, "mine.fmu"])
    assert {path.read_text() for path in tmp_path.iterdir()} == {"old"}
    capsys.readouterr()
    assert main(["export", "--scene", "heave", "-o", str(tmp_path)]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / "pipe.fmu")]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.fmu", "pipe.fmu"]
    assert zipfile.is_zipfile(tmp_path / "pipe.fmu")


@pytest.mark.parametrize("damping", ["internal", "numerical"])
def test_a_damping_that_the_pipe_has_no_output_for_is_refused(damping):
    """Its energy would be missing from the balance."""
    with Fmu(prepare(reading.load("paper"))["pipe"], "pipe") as pipe:
        reason = f"^pipe: initialisation: {damping}_damping: adds the output {damping}_dissipation; such an FMU must be exported anew$"
        with pytest.raises(FmuFailed, match=reason):
            pipe.initialize({f"{damping}_damping": 0.05})


def test_a_pipe_run_by_python_gets_new_nodes_for_another_length_where_its_own_are_dropped():
    exported = prepare(reading.load("paper"), ["--python"])["pipe"]
    with Fmu(exported, "pipe") as pipe, pytest.raises(FmuFailed, match=r"length 1210 m; an empty one places the nodes anew"):
        pipe.initialize({"length": 1210.0})
    with Fmu(exported, "pipe") as pipe:
        pipe.initialize({"length": 1210.0, "nodes_at": "[]"})
        assert pipe.get("s")[[0, -1]].tolist() == [0.0, 1210.0]
        assert pipe.get("pipe_length")[0] == pytest.approx(1210.0, rel=1e-3)


@pytest.mark.parametrize("unit", ["pipe", "vessel"])
def test_a_rollback_is_bitwise_and_cheap(unit):
    """All outputs, after a live and after a serialised state; saving, restoring and freeing cost less than half a step."""
    loaded = reading.load("paper", BUSY)
    fmu_file = prepare(loaded)[unit]
    with Fmu(fmu_file, unit) as fmu:
        fmu.initialize()
        flows = ("velocity", "angular_velocity") if unit == "pipe" else ("force", "moment")
        held = np.array([0.3, -0.2, 0.1, 1e-3, 2e-3, -1e-3]) * (1.0 if unit == "pipe" else 1e6)
        everything = tuple(fmu.names("output"))
        rollback, stepping = [], []
        for k in range(40):
            begun = time.perf_counter()
            state = fmu.snapshot()
            fmu.restore(state)
            fmu.release(state)
            saved = time.perf_counter()
            fmu.set(flows, held * np.sin(k))
            fmu.step(0.1 * k, 0.1)
            stepping.append(time.perf_counter() - saved)
            rollback.append(saved - begun)
        assert np.median(rollback) < 0.5 * np.median(stepping)
        state = fmu.snapshot()
        copy = fmu.deserialize(fmu.serialize(state))
        fmu.step(4.0, 0.1)
        expected = fmu.get(everything)
        for saved_state in (state, copy):
            fmu.set(flows, np.zeros(6))
            fmu.step(4.1, 0.2)
            fmu.restore(saved_state)
            fmu.step(4.0, 0.1)
            np.testing.assert_array_equal(fmu.get(everything), expected)


def test_statics_prints_the_equilibrium_as_json(capsys):
    assert main(["statics", "paper", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {
        "top_force_e_N", "top_moment_e_N_m", "foot_force_e_N", "foot_moment_e_N_m", "top_tension_N", "stretch_m",
        "lowest_point_m", "touchdown_s_m", "s_m", "position_e_m", "tension_N", "bending_moment_N_m", "shear_N",
    } <= set(found)  # fmt: skip
    assert found["touchdown_s_m"] is None
    assert found["top_tension_N"] == pytest.approx(np.linalg.norm(found["top_force_e_N"]), rel=1e-4)  # it hangs freely
    weight = 759.1353686 * 1200.0
    assert found["top_force_e_N"][2] + found["foot_force_e_N"][2] == pytest.approx(-weight, rel=1e-9)


def test_statics_prints_a_table(capsys):
    assert main(["statics", "pipelay", "--set", "start.x=780"]) == 0
    printed = capsys.readouterr().out
    assert "top tension" in printed
    assert "touchdown at    S =" in printed
