"""A scene of any two FMUs from the command line: what it computes, what it refuses, and what an FMU that dies leaves behind."""

import json
import os
import pty
import signal
import subprocess
import sys
from contextlib import suppress
from zipfile import ZipFile

import numpy as np
import pytest
from tied_units import ENERGY, SCENE, begun, columns, command, failing, until_slow
from units.toys import build_pair

from master.__main__ import main
from master.fmi.build import Recipe, build_fmu
from master.studies.stability.coupled import UNITS
from master.studies.stability.published import LIM


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIPELAY_CACHE", str(tmp_path_factory.mktemp("cache")))
        place = tmp_path_factory.mktemp("scene")
        build_pair(place, failure={"above": 1e9})
        rewritten(place / "spring.fmu", place / "fixed.fmu", {'StepSize="true"': 'StepSize="false"'})
        kilonewton = {'"N"': '"kN"', '<BaseUnit kg="1" m="1" s="-2"': '<BaseUnit factor="1000" kg="1" m="1" s="-2"'}
        rewritten(place / "spring.fmu", place / "kilo.fmu", kilonewton)
        for unit in ("Spring", "Mass"):
            build_fmu(Recipe(UNITS / "linear_fmu", f"slave.{unit}Unit", {}), place / f"linear_{unit}.fmu".lower())
        energy = silent = SCENE
        for mark, line in ENERGY.items():
            energy, silent = energy.replace(mark, line), silent.replace(mark, "")
        (place / "tied.toml").write_text(energy)
        (place / "silent.toml").write_text(silent)
        yield place


def rewritten(fmu, target, changes):
    """A copy of an FMU with another model description."""
    with ZipFile(fmu) as source, ZipFile(target, "w") as copy:
        for name in source.namelist():
            content = source.read(name)
            for old, new in changes.items() if name == "modelDescription.xml" else ():
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            copy.writestr(name, content)


def ran(folder, out, *changes, scene="tied"):
    code = main(["run", str(folder / f"{scene}.toml"), *(f"--set={change}" for change in changes), "-o", str(out)])
    return code, json.loads((out / "summary.json").read_text())


def test_it_runs_like_any_other_and_its_ledger_closes(folder, tmp_path, capsys):
    code, summary = ran(folder, tmp_path)
    assert code == 0
    assert summary["ledger_closure_J"] <= 1e-9 * summary["exchanged_energy_J"]
    assert summary["macro_steps"] == 50
    assert summary["impedance_solves"] <= 3 * 50
    found = columns(tmp_path)
    # damped oscillator 2 x'' + 0.1 x' + 4 x = 0, midpoint rule: second order
    decay, w = 0.1 / 4.0, np.sqrt(2.0 - (0.1 / 4.0) ** 2)
    exact = np.exp(-decay * found["time"]) * np.sin(w * found["time"]) / w
    np.testing.assert_allclose(found["mass.position[1]"], exact, atol=1e-2)
    np.testing.assert_allclose(found["coil.stretch[2]"], found["mass.position[2]"], atol=1e-13)
    np.testing.assert_allclose(found["interface_residual_sum"], np.cumsum(np.abs(found["interface_residual"])), rtol=1e-12)
    assert (tmp_path / "energy.png").read_bytes().startswith(b"\x89PNG")
    assert "energy check" in capsys.readouterr().out


def test_one_pair_of_vectors_serves_as_well_as_two(folder, tmp_path):
    one = 'bond.pairs=[{effort="force", flow="velocity", floor=1e-6}]'
    for name, change in (("two", "title='two'"), ("one", one)):
        assert ran(folder, tmp_path / name, change)[0] == 0
    both = [columns(tmp_path / name) for name in ("one", "two")]
    for name in ("mass.position[1]", "mass.position[2]", "coil.stretch[1]"):
        np.testing.assert_allclose(both[0][name], both[1][name], atol=1e-9)


def test_a_pair_of_scalars_couples_the_published_oscillator(folder, tmp_path):
    """The LIM oscillator from a scene file, against the matrix exponential."""
    energy = 'energy = {stored = ["kinetic_energy", "elastic_energy"], dissipated = ["damping_dissipation"], bond = "bond_work"}'
    halves = (("spring", LIM.first), ("mass", LIM.second))
    lines = ["[simulation]", "duration = 1.0", "macro_step = 1e-3", "[bond]", "impedance = 'spring'", "mobility = 'mass'"]
    lines.append("pairs = [{effort = 'force', flow = 'velocity', floor = 1e-6}]")
    for name, parameters in halves:
        values = ", ".join(f"{key} = {value}" for key, value in parameters.items())
        lines += [f"[units.{name}]", f"fmu = 'linear_{name}.fmu'", f"parameters = {{{values}}}", "outputs = ['position']", energy]
    (folder / "lim.toml").write_text("\n".join(lines))
    code, summary = ran(folder, tmp_path, scene="lim")
    found = columns(tmp_path)
    assert code == 0
    assert summary["ledger_closure_J"] <= 1e-9 * summary["exchanged_energy_J"]
    exact = LIM.exact(found["time"])
    np.testing.assert_allclose(found["spring.position"], exact[:, 0], atol=5e-3)  # of 20 m
    np.testing.assert_allclose(found["mass.position"], exact[:, 1], atol=5e-3)


FIXED = "units.coil.fmu='fixed.fmu'"


def test_no_other_step_is_asked_of_a_unit_that_cannot_vary_it(folder, tmp_path, capsys):
    code, summary = ran(folder, tmp_path, FIXED)
    assert (code, summary["macro_steps"]) == (0, 50)
    assert "no step is halved, for coil cannot vary it" in capsys.readouterr().out
    code, summary = ran(folder, tmp_path, FIXED, failing("message"))
    assert (code, summary["rejected_steps"]) == (1, 1)
    assert "with a step of 0.1 s: coil: step of 0.1 s at 2 s: planted" in summary["message"]
    assert summary["message"].endswith("an FMU takes no other step")
    code, summary = ran(folder, tmp_path, FIXED, "coupling.rollback=false", "coupling.energy_check=2.0")
    assert (code, summary["macro_steps"]) == (0, 50)


def test_without_reported_energies_the_check_is_the_residual_alone_and_says_so(folder, tmp_path, capsys):
    code, summary = ran(folder, tmp_path, scene="silent")
    assert code == 0
    assert summary["exchanged_energy_J"] > 1.0
    assert "the units report no energies" in capsys.readouterr().out


@pytest.mark.parametrize("scene", ["tied", "silent"])
def test_without_rollback_it_says_that_nothing_is_iterated_and_what_is_left(folder, tmp_path, capsys, scene):
    named = 'bond.impedance_derivative="impedance"', 'bond.mobility_derivative="mobility"'
    code, summary = ran(folder, tmp_path, "coupling.rollback=false", "coupling.energy_check=2.0", *named, scene=scene)
    assert code == 0
    assert summary["impedance_solves"] == summary["mobility_solves"] == summary["macro_steps"] == 50
    assert summary["interface_residual_J"] > 1e-6
    printed = capsys.readouterr().out
    assert "not iterated" in printed
    assert f"the bond made {summary['interface_residual_J']:.2g} J" in printed


def test_the_check_measures_the_same_for_every_scheme(folder, tmp_path):
    left = {}
    for scheme in ("energy-consistent", "serial", "parallel"):
        code, summary = ran(folder, tmp_path / scheme, f'coupling.scheme="{scheme}"', 'coupling.on_violation="warn"')
        assert (code == 0) == (scheme == "energy-consistent")
        found = columns(tmp_path / scheme)
        made = np.diff(found["coil.top_work"] + found["mass.bond_work"])
        np.testing.assert_allclose(found["interface_residual"][1:], made, atol=1e-12)
        left[scheme] = summary["interface_residual_J"] / summary["exchanged_energy_J"]
    assert left["energy-consistent"] < 1e-9 < 1e-2 < left["serial"] < left["parallel"]


def test_what_the_coupling_lets_pass_is_warned_of_refined_or_stops_the_run_as_the_scene_says(folder, tmp_path):
    sloppy = "units.coil.parameters={stiffness=4.0, hardening=30.0}", "coupling.tolerance=1e-3", "coupling.energy_check=1e-6"
    runs = {action: ran(folder, tmp_path / action, *sloppy, f"coupling.on_violation='{action}'") for action in ("warn", "refine", "stop")}
    ends = {action: (code, summary["status"], summary["energy_check_passed"]) for action, (code, summary) in runs.items()}
    assert ends == {"warn": (1, "completed", False), "refine": (0, "completed", True), "stop": (1, "stopped", False)}
    summary = runs["refine"][1]
    assert summary["rejected_steps"] > 0
    assert max(summary["ledger_closure_J"], summary["interface_residual_J"]) <= 1e-6 * summary["exchanged_energy_J"]
    assert runs["warn"][1]["ledger_closure_J"] > 1e-6 * runs["warn"][1]["exchanged_energy_J"]
    assert runs["stop"][1]["duration_s"] < 5.0


MISTAKES = {
    "a last step that is shorter": (
        f"{FIXED}\nsimulation.duration=5.03",
        "simulation.duration = 5.03: must be a multiple of macro_step = 0.1 s, which unit coil cannot vary",
    ),
    "a step to be refined": (
        f"{FIXED}\ncoupling.on_violation='refine'",
        "coupling.on_violation = 'refine': must be stop or warn, for unit coil cannot vary its step",
    ),
    "kilonewtons": ("units.coil.fmu='kilo.fmu'", "bond.pairs[1]: force is in kN and force in N; must be the same"),
    "no power": (
        'bond.pairs=[{effort="moment", flow="velocity", effort_input="moment", flow_input="velocity", floor=1}]',
        "bond.pairs[1]: moment [N.m] times velocity [m/s] must be a power in W",
    ),
    "no energy": (
        "units.coil.energy={stored=['stretch'], bond='force'}",
        "units.coil.energy.bond = 'force': is in N, must be in J",
    ),
    "misspelt key": ("bond.pairs=[{efort='force', flow='velocity', floor=1}]", "bond.pairs[1].efort = 'force': unknown key"),
    "no such file": ('units.coil.fmu="none.fmu"', "units.coil.fmu = 'none.fmu': no such file"),
    "no FMU": ('units.coil.fmu="tied.toml"', "units.coil.fmu = 'tied.toml': "),
    "unknown unit": ('bond.impedance="cable"', "bond.impedance = 'cable': must be one of coil, mass"),
    "one unit twice": ('bond.mobility="coil"', "bond.mobility = 'coil': must be another unit"),
    "unknown port": ('bond.pairs=[{effort="pull", flow="velocity", floor=1}]', "bond.pairs[1].effort = 'pull': unit coil has no such"),
    "wrong causality": (
        'bond.pairs=[{effort="velocity", flow="velocity", floor=1}]',
        "bond.pairs[1].effort = 'velocity': is of causality input in unit coil, must be output",
    ),
    "sizes": (
        'bond.pairs=[{effort="force", flow="kinetic_energy", flow_input="velocity", floor=1}]',
        "bond.pairs[1]: force has 3 values and kinetic_energy 1; must be equal",
    ),
    "no floor": ('bond.pairs=[{effort="force", flow="velocity", floor=0}]', "bond.pairs[1].floor = 0: must be > 0"),
    "derivative": ('bond.impedance_derivative="force"', "bond.impedance_derivative = 'force': has 3 values, must have 6 x 6"),
    "yielding": ('bond.yielding="impedance"', "bond.yielding = 'impedance': must have a met_flow in every pair"),
    "recorded": ('units.mass.outputs=["nowhere"]', "units.mass.outputs = 'nowhere': unit mass has no such output"),
    "parameter": ("units.mass.parameters={weight=1}", "units.mass.parameters.weight = 1: unknown parameter"),
    "texts for an input": ('units.mass.inputs={force=["a", "b", "c"]}', "units.mass.inputs.force = ['a', 'b', 'c']: must be of type Real"),
    "text for a parameter": ('units.coil.parameters={stiffness="a"}', "units.coil.parameters.stiffness = 'a': must be of type Real"),
    "two for one": ("units.coil.parameters={stiffness=[1, 2]}", "units.coil.parameters.stiffness = [1, 2]: must have 1 value"),
    "input": ("units.mass.inputs={force=[1]}", "units.mass.inputs.force = [1]: must have 3 values"),
    "connection": ('connections=[{from="coil.stretch", to="mass.force"}]', "connections[1]: coil.stretch has 6 values and mass.force 3"),
    "connected unit": ('connections=[{from="x.y", to="mass.force"}]', "connections[1].from = 'x.y': must begin with one of coil, mass"),
    "pipe": ("pipe={}", "pipe = {}: unknown key; allowed in a scene of two FMUs"),
    "shapes": ("simulation.recording_step=1", "simulation.recording_step: must be absent"),
    "refine": ('coupling={on_violation="refine", rollback=false}', "coupling.on_violation = 'refine': must be stop or warn"),
}


@pytest.mark.parametrize(("change", "message"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_line_and_exit_code_2(folder, tmp_path, capsys, change, message):
    changes = [f"--set={line}" for line in change.split("\n")]
    assert main(["run", str(folder / "tied.toml"), *changes, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"pipelay: {message}")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_commands_for_a_pipe_refuse_it(folder, capsys):
    assert main(["statics", str(folder / "tied.toml")]) == 2
    assert "needs one with [pipe]" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["message", "arithmetic", "bug", "nan"])
def test_an_fmu_that_fails_for_good_ends_the_run_with_its_results_so_far(folder, tmp_path, capsys, kind):
    code, summary = ran(folder, tmp_path, failing(kind))
    assert code == 1
    assert summary["status"] == "failed"
    assert "failed at 2 s" in summary["message"]
    assert summary["duration_s"] == pytest.approx(2.0)
    assert columns(tmp_path)["time"][-1] == pytest.approx(2.0)
    assert ("not finite" if kind == "nan" else "planted") in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "how"),
    [("crash", "was ended by SIGSEGV"), ("abort", "was ended by SIGABRT"), ("exit", "was ended from within, with exit code 0")],
)
def test_an_fmu_that_takes_its_process_with_it_ends_in_one_line_and_the_results_so_far(folder, tmp_path, kind, how):
    out = tmp_path / "out"
    done = subprocess.run(command(folder, out, kind), check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f"pipelay: the process {how} at t = 2 s; results so far in {out}\n"
    found, summary = columns(out), json.loads((out / "summary.json").read_text())
    np.testing.assert_allclose(found["time"], 0.1 * np.arange(21), atol=1e-12)
    assert (summary["status"], summary["duration_s"]) == ("died", pytest.approx(2.0))
    assert summary["message"] == f"the process {how} at t = 2 s"
    assert summary["exchanged_energy_J"] == found["exchanged"][-1]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert sorted(path.name for path in out.iterdir()) == ["energy.png", "signals.csv", "summary.json"]


def test_the_results_of_an_earlier_run_are_not_taken_for_those_of_one_that_dies_before_its_own(folder, tmp_path):
    out = tmp_path / "out"
    ran(folder, out)
    before = (out / "summary.json").read_text()
    died = "import os, sys; from master.run import two_fmu_drive; two_fmu_drive.Bonded.__init__ = lambda *_: os._exit(3)"
    call = f"{died}; sys.argv[1:] = {command(folder, out, 'crash')[3:]!r}; from master.__main__ import program; sys.exit(program())"
    done = subprocess.run([sys.executable, "-c", call], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, "pipelay: the process was ended from within, with exit code 3\n")
    assert (out / "summary.json").read_text() == before


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_command_is_passed_on_and_ends_the_run_at_the_next_step(folder, tmp_path, which):
    child = begun(folder, tmp_path)
    child.send_signal(which)
    printed, complaint = child.communicate()
    assert (child.returncode, complaint) == (1, "")
    assert "interrupted at" in printed
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "interrupted"


def test_ctrl_c_at_a_terminal_reaches_both_processes_and_ends_the_run_once(folder, tmp_path):
    process, terminal = pty.fork()
    if process == 0:
        os.execv(sys.executable, command(folder, tmp_path, "wait"))
    until_slow(tmp_path)
    os.write(terminal, b"\x03")
    printed = b""
    with suppress(OSError):  # how a terminal ends
        while True:
            printed += os.read(terminal, 4096)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 1
    assert b"interrupted at" in printed
    assert b"Traceback" not in printed


def test_the_run_ends_with_a_command_that_is_killed(folder, tmp_path):
    child = begun(folder, tmp_path)
    child.kill()
    child.communicate()  # until nobody holds the streams, its worker neither
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "interrupted"


def test_what_a_unit_says_of_its_start_and_of_its_steps_is_in_the_report(folder, tmp_path, capsys):
    code, summary = ran(folder, tmp_path, failing("remark"))
    assert code == 0
    (told,) = summary["remarks"]["coil"]
    assert (told["times"], told["first"], told["last"]) == (30, "planted remark, 50 % heard", "planted remark, 50 % heard")
    assert (told["first_s"], told["last_s"]) == (pytest.approx(2.1), pytest.approx(5.0))
    assert summary["start_remarks"] == {"coil": ["planted at the start, 10 % heard"]}
    out = capsys.readouterr().out
    assert "coil start    planted at the start, 10 % heard" in out
    assert "coil remark   at 2.1 s: planted remark, 50 % heard; 30 times, last at 5 s: the same" in out
