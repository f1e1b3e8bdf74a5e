"""The commands as a user meets them: exit codes, one-line mistakes, files written whatever ends a run."""

import io
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from still_drive import SHORT, Ports, StillDrive

from master.__main__ import main
from master.fmu.errors import FmuFailed
from master.run import prepared, simulate
from master.run.pipe_drive import pose_gap, top_tension
from master.scene import keys
from master.scene.reading import FOUND, from_mapping, load

REQUIRED = """
scene duration_s macro_steps rejected_steps pipe_solves vessel_solves wall_s realtime_factor exchanged_energy_J
interface_residual_J ledger_closure_J pose_gap_m pose_gap_rad final_vessel_position_m final_vessel_speed_m_s
top_tension_max_N bending_moment_max_N_m stretch_m"""


def test_a_run_writes_every_file_of_the_results(still, tmp_path, capsys):
    still()
    assert main(["run", *SHORT, "-o", str(tmp_path / "out")]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"signals.csv", "shapes.npz", "summary.json", "energy.png"} <= names
    assert sorted(name[:4] for name in names if name.startswith("fig")) == [f"fig{n}" for n in range(3, 10)]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["macro_steps"] == 20
    assert summary["stretch_m"] == pytest.approx(0.1)
    assert set(REQUIRED.split()) <= set(summary)
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]
    printed = capsys.readouterr()
    assert "energy check" in printed.out
    assert "passed" in printed.out
    assert printed.err == ""


def test_shapes_are_recorded_once_a_step_at_most_and_by_default(still, tmp_path):
    still()
    assert main(["run", *SHORT, "--set", "simulation.recording_step=0.01", "-o", str(tmp_path / "a")]) == 0
    with np.load(tmp_path / "a" / "shapes.npz") as shapes:
        assert len(shapes["t"]) == 21
    scene = load("paper", SHORT[1::2])
    mapping = scene.mapping | {"simulation": {"duration": 2.0, "macro_step": 0.1}}
    result = simulate.simulate(from_mapping(mapping, "paper"), tmp_path / "b", io.StringIO())
    assert result.summary["stretch_m"] == pytest.approx(0.1)
    with np.load(tmp_path / "b" / "shapes.npz") as shapes:
        np.testing.assert_allclose(shapes["t"], (0.0, 0.5, 1.0, 1.5, 2.0))
    assert (tmp_path / "b" / "fig8_bending.png").exists()


@pytest.mark.parametrize(
    ("fate", "status", "word"),
    [
        ("fail", "failed", "no convergence"),
        ("interrupt", "interrupted", "at 1.1 s of 2 s"),
        ("leak", "stopped", "closure error 1 J"),
    ],
)
def test_whatever_ends_a_run_its_results_so_far_are_kept(still, tmp_path, capsys, fate, status, word):
    still(fate)
    assert main(["run", *SHORT, "-o", str(tmp_path)]) == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == status
    assert 0.9 < summary["duration_s"] < 1.2
    assert len(np.loadtxt(tmp_path / "signals.csv", delimiter=",", skiprows=1)) == round(summary["duration_s"] / 0.1) + 1
    assert capsys.readouterr().out.count(word) == 1


def test_a_broken_balance_that_is_only_warned_of_still_fails_at_the_end(still, monkeypatch, tmp_path):
    still()
    monkeypatch.setattr(StillDrive.ledger, "complaint", "closure error 1 J")
    assert main(["run", *SHORT, "-o", str(tmp_path)]) == 1
    assert json.loads((tmp_path / "summary.json").read_text())["duration_s"] == 2.0


def test_results_replace_those_of_an_earlier_run_and_nothing_else(still, tmp_path):
    still()
    (tmp_path / "fig3_old.png").touch()
    (tmp_path / "notes.txt").touch()
    assert main(["run", *SHORT, "-o", str(tmp_path)]) == 0
    assert not (tmp_path / "fig3_old.png").exists()
    assert (tmp_path / "notes.txt").exists()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "papr"], "did you mean paper?"),
        (["run", "missing.toml"], "no such file"),
        (["run", "--set", "simulation.duration=-1"], "simulation.duration = -1"),
        (["run", "-o", __file__], "is a file, not a folder"),
        (["export", "-o", f"{__file__}/fmus"], "is a file, not a folder"),
        (["run", "-o", "/proc/pipelay"], "--output = '/proc/pipelay': cannot be written"),
        (["export", "-o", "/proc/pipelay"], "--output = '/proc/pipelay': cannot be written"),
        (["statics", "paper", "--set", "pipe"], "--set pipe"),
        (["statics", "paper", "--set", "pipe.top_range=200"], "pipe.top_range = 200: must be"),
        (["statics", "paper", "--set", f"pipe.length=1{'0' * 400}"], "must be finite"),
        (["statics", "paper", "--set", "vessel.added_mass.sway_yaw=1e9"], "vessel.added_mass.sway_yaw = 1e+09: must"),
        (["statics", "paper", "--set", "vessel.damping.heave_pitch=1e12"], "vessel.damping.heave_pitch = 1e+12: must"),
        (["run", "heave", "--set", "coupling.rollback=false"], "coupling.rollback = false: must be true"),
    ],
)
def test_a_mistake_is_one_line_on_the_error_stream_with_exit_code_2(arguments, named, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert named in error
    assert error.startswith("pipelay: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize("command", ["run", "export"])
def test_a_refused_scene_leaves_no_folder_behind(command, tmp_path, capsys):
    assert main([command, "--set", "pipe.lenght=1", "-o", str(tmp_path / "a" / "b")]) == 2
    assert "pipe.lenght = 1" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_keys_listed_are_those_that_a_scene_may_say(capsys):
    assert main(["keys"]) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert len(set(names)) == len(names)
    assert {"pipe.length", "pipe.section.wall_thickness", "vessel.controller.x", "environment.current.velocity"} <= set(names)
    for table in ("pipe", "vessel"):
        own = {f"{table}.{field.name}" for field in fields(keys.TABLES[table])}
        listed = {".".join(name.split(".")[:2]).removesuffix("[]") for name in names if name.startswith(f"{table}.")}
        assert own - listed == {name for name in FOUND if name.startswith(f"{table}.")}


@pytest.mark.parametrize("arguments", [[], ["simulate"], ["run", "--sett", "a=1"]])
def test_a_wrong_call_is_refused_by_the_parser_with_exit_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: pipelay" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["statics", "--help"], ["export", "--help"]])
def test_help_teaches(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0
    assert "pipelay" in capsys.readouterr().out


def test_scenes_lists_one_line_each_and_where_their_files_are(capsys):
    assert main(["scenes"]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["free-decay", "heave", "paper", "pipelay"]
    assert (Path(last.removeprefix("files in ")) / "paper.toml").is_file()


def test_the_module_runs_as_a_program_and_bears_a_closed_pipe():
    command = f"{sys.executable} -m master scenes | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("free-decay")
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("child", "code", "named"),
    [
        (
            'print(\'{"error": "pipe.outer_diameter = -0.4: must be > 0 m", "exit": 2}\')',
            2,
            "pipe.outer_diameter = -0.4",
        ),
        ('print(\'{"error": "no equilibrium: residual 1e3 N", "exit": 1}\')', 1, "no equilibrium"),
        ("raise SystemExit(3)", 1, "broke off with exit code 3"),
    ],
)
def test_what_the_preparation_reports_reaches_the_user(monkeypatch, tmp_path, capsys, child, code, named):
    monkeypatch.setattr(prepared, "COMMAND", (sys.executable, "-c", child))
    assert main(["run", "-o", str(tmp_path / "out")]) == code
    assert named in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_the_preparation_ends_the_child_and_leaves_nothing(monkeypatch, tmp_path, capsys, which):
    note = f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))"
    child = f"import os, time; {note}; os.kill(os.getppid(), {int(which)}); time.sleep(60)"
    monkeypatch.setattr(prepared, "COMMAND", (sys.executable, "-c", child))
    before = signal.getsignal(which)
    assert main(["run", "-o", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == "pipelay: interrupted\n"
    assert [path.name for path in tmp_path.iterdir()] == ["pid"]
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
    assert signal.getsignal(which) is before


def test_an_fmu_that_swallows_the_interruption_while_loading_is_interrupted_all_the_same(monkeypatch, tmp_path, capsys):
    def swallow(*_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise FmuFailed("Pipe: cannot be loaded") from None

    monkeypatch.setattr(simulate, "prepare", lambda scene: None)
    monkeypatch.setattr(simulate, "open_drive", swallow)
    assert main(["run", "-o", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == "pipelay: interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_that_the_loading_swallows_ends_the_run_after_its_first_step(still, monkeypatch, tmp_path, capsys):
    def swallow(*_):
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)

    still()
    monkeypatch.setattr(simulate, "prepare", swallow)
    assert main(["run", *SHORT, "-o", str(tmp_path)]) == 1
    assert "interrupted at 0.1 s of 2 s" in capsys.readouterr().out
    monkeypatch.setattr(simulate, "prepare", lambda _: None)
    assert main(["run", *SHORT, "-o", str(tmp_path)]) == 0  # and no other run


def test_the_preparation_bears_that_nobody_reads_its_answer():
    command = [sys.executable, "-m", "master.with_units.prepare"]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    child.stdout.close()
    child.stdin.write(b'{"pipe": 1}')
    child.stdin.close()
    assert child.stderr.read() == b""
    assert child.wait() == 0


def test_progress_is_shown_on_a_terminal_only(still, tmp_path):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    still()
    scene = load("paper", SHORT[1::2])
    terminal, pipe = Terminal(), io.StringIO()
    simulate.simulate(scene, tmp_path / "a", terminal)
    simulate.simulate(scene, tmp_path / "b", pipe)
    assert "s simulated" in terminal.getvalue()
    assert pipe.getvalue() == ""


def test_pose_gap_measures_small_angles_to_round_off():
    angle = 1e-12
    pipe = Ports(top_position=(1, 2, 3), top_quaternion=(np.cos(0.3), 0, np.sin(0.3), 0))
    turned = (np.cos(0.3 + angle / 2), 0, np.sin(0.3 + angle / 2), 0)
    vessel = Ports(hang_off_position=(1, 2, 3 + 1e-9), hang_off_quaternion=turned)
    gap = pose_gap(pipe, vessel)
    assert gap[("pose_gap", "m")] == pytest.approx(1e-9, rel=1e-6)
    assert gap[("pose_gap_angle", "rad")] == pytest.approx(angle, rel=1e-3)


def test_top_tension_is_the_pull_along_the_section():
    half = 0.5 * np.radians(67.38)
    pull_on_vessel = -1e6 * np.array([np.cos(2 * half), 0.0, -np.sin(2 * half)])
    pipe = Ports(end_force=pull_on_vessel, top_quaternion=(np.cos(half), 0.0, np.sin(half), 0.0))
    assert top_tension(pipe)[("top_tension", "N")] == pytest.approx(1e6)
