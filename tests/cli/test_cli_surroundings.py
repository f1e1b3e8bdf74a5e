"""Bad surroundings: the right result, or one line and the documented exit code.

Streams closed or full, a full disk, no cache, no home, modules of the working folder, another interpreter, a killed server, two runs in
one folder, an ASCII screen. Most of them around a run of a spring tied to a body, `test_coupling_scene`; caches of other users, too, in
`test_fmi_cache`.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import threading
from contextlib import contextmanager
from pathlib import Path
from time import sleep
from zipfile import ZipFile

import numpy as np
import pytest
from still_drive import SHORT, StillDrive
from tied_units import ENERGY, SCENE, begun, columns, failing
from units.toys import SPRING, build_pair

from master.__main__ import main
from master.fmi import build, cache
from master.fmi.build import build_fmu, cached_fmu
from master.fmi.cache import cache_folder
from master.process import screen
from master.process.folders import taken
from master.results import figures

PROGRAM = (sys.executable, "-P", "-m", "master")
FULL = "No space left on device"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("tied")
    build_pair(place, failure={"above": 1e9})
    text = SCENE.replace("A spring", "Ein Körper, \\u001b[31mund eine Feder")
    for mark, line in ENERGY.items():
        text = text.replace(mark, line)
    (place / "tied.toml").write_text(text, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def expected(folder):
    assert main(["run", str(folder / "tied.toml"), "--set", "simulation.duration=0.5", "-o", str(folder / "out")]) == 0
    return columns(folder / "out")


def ran(*arguments, streams="", cwd=None, call=PROGRAM, **environment):
    """The program, or another, with a shell's redirections; a variable that is None is not set."""
    given = {key: value for key, value in (os.environ | environment).items() if value is not None}
    command = ["sh", "-c", f'exec "$@" {streams}', "sh", *call, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=given, capture_output=True, text=True, timeout=300)


def tied(folder, *more):
    return ["run", folder / "tied.toml", "--set", "simulation.duration=0.5", *more]


def whole(out, expected):
    """The results are all there and right."""
    np.testing.assert_array_equal(np.array([*columns(out).values()]), np.array([*expected.values()]))
    assert json.loads((out / "summary.json").read_text())["status"] == "completed"
    assert sorted(path.name for path in out.iterdir()) == ["energy.png", "signals.csv", "summary.json"]


def fake_modules(folder):
    """Modules that must not be taken for those of the program, its libraries or the standard library."""
    for name in ("master", "pipe_fmu", "vessel_fmu", "numba", "pythonfmu", "json", "signal", "subprocess", "runpy", "ziglang", "argparse"):
        (folder / f"{name}.py").write_text(f"raise RuntimeError('{name} of the working folder')\n")
    return folder


GOOD = {  # streams, environment
    "no standard output": (">&-", {}),
    "a full standard output": (">/dev/full", {}),
    "no error stream": ("2>&-", {}),
    "no streams": ("<&- >&- 2>&-", {}),
    "full streams": (">/dev/full 2>/dev/full", {}),
    "an ASCII screen": ("", {"PYTHONIOENCODING": "ascii"}),
    "no UTF-8": ("", {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}),
    "no home": ("", {"HOME": None, "PIPELAY_CACHE": None}),
    "no folder for a cache": ("", {"HOME": "/proc/absent", "PIPELAY_CACHE": "/proc/absent"}),
    "disabled JIT": ("", {"NUMBA_DISABLE_JIT": "1"}),
    "the interpreter in a process of its own, without streams": ("<&- >&- 2>&-", {"PIPELAY_PYTHON": sys.executable}),
}


@pytest.mark.parametrize("kind", GOOD)
def test_a_run_is_whole_all_the_same(kind, folder, expected, tmp_path):
    streams, environment = GOOD[kind]
    done = ran(*tied(folder, "-o", tmp_path / "out"), streams=streams, **environment)
    assert (done.returncode, done.stderr) == (0, "")
    whole(tmp_path / "out", expected)
    if not streams:
        assert "\x1b" not in done.stdout
        assert r"per, \x1b[31mund eine Feder" in done.stdout
        assert done.stdout.isascii() or kind == "disabled JIT" or "home" in kind or "cache" in kind


def test_modules_of_the_working_folder_shadow_nothing(folder, expected, tmp_path):
    script = Path(sys.executable).with_name("pipelay")
    fake = fake_modules(tmp_path)
    for call in ((script,), (sys.executable, "-m", "master")):
        if call[-1] == "master":  # with these Python itself runs nothing else
            (fake / "master.py").unlink()
            (fake / "runpy.py").unlink()
        done = ran(*tied(folder, "-o", "out"), cwd=fake, call=call)
        assert (done.returncode, done.stderr) == (0, "")
        whole(tmp_path / "out", expected)
    done = ran("run", "heave", "--set", "pipe.lenght=1", "-o", "out", cwd=fake_modules(tmp_path), call=(script,))  # refused by the child
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "did you mean length?" in done.stderr


def test_modules_of_a_hosts_working_folder_shadow_nothing_in_an_fmu(folder, tmp_path):
    host = """
        import sys
        from master.fmu.instance import Fmu
        sys.path.insert(0, "")
        with Fmu(sys.argv[1]) as fmu:
            fmu.initialize({"offset": [2, 0, 0]})
            print(fmu.get("elastic_energy")[0], "numba" in sys.modules)
    """
    file = build_fmu(SPRING, tmp_path / "spring.fmu")
    done = ran(file, cwd=fake_modules(tmp_path), call=(sys.executable, "-P", "-c", textwrap.dedent(host)))
    assert (done.stdout, done.stderr) == ("2.0 True\n", "")


@pytest.mark.parametrize(
    ("streams", "message"), [(">/dev/full", FULL), (">&-", "Bad file descriptor"), (">/dev/full 2>&-", ""), (">/dev/full 2>/dev/full", "")]
)
def test_a_result_that_cannot_be_printed_is_a_failure(streams, message):
    done = ran("scenes", streams=streams)
    assert done.returncode == 1
    assert done.stderr == (f"pipelay: standard output: cannot be written ({message})\n" if message else "")


@pytest.mark.parametrize(("streams", "code"), [(">/dev/full", 0), ("2>/dev/full", 2), ("2>&-", 2)])
def test_help_and_a_wrong_call_bear_such_streams(streams, code):
    done = ran("--help" if code == 0 else "simulate", streams=streams)
    assert (done.returncode, done.stderr) == (code, "")


@contextmanager
def full_disk(size):
    """No file can grow beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [0, 100, 1000, 2500, 20_000])
def test_a_disk_that_fills_up_ends_a_run_in_one_line_with_its_results_so_far(still, monkeypatch, tmp_path, capsys, size):
    still()
    monkeypatch.setattr(StillDrive.ledger, "names", ["pipe.kinetic_energy", "interface_residual_sum", "closure", "exchanged"])
    monkeypatch.setattr(figures, "draw_all", lambda folder, *_: (folder / "energy.png").write_bytes(bytes(30_000)))
    with full_disk(size):
        assert main(["run", *SHORT, "-o", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("pipelay: the process could not write")
    assert "(File too large)" in printed.err
    assert printed.err.count("\n") == 1
    if size > 1000:
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["status"] == "failed"
        assert "could not write" in summary["message"]
        assert columns(tmp_path / "out")["time"][-1] == summary["duration_s"]
    assert not list(tmp_path.glob("**/.*"))


def test_a_full_disk_under_an_export_is_one_line_and_leaves_what_was_there(tmp_path, capfd):
    (tmp_path / "pipe.fmu").write_text("old")
    with full_disk(1000):
        assert main(["export", "--scene", "heave", "-o", str(tmp_path)]) == 1
    error = capfd.readouterr().err
    assert "File too large" in error
    assert error.count("\n") == 1
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("pipe.fmu", "old")]


def test_a_temporary_directory_of_any_name_serves(folder, expected, tmp_path):
    place = tmp_path / "Zwischenablage für Übles, 100 %20"
    place.mkdir()
    done = ran(*tied(folder, "-o", tmp_path / "out"), TMPDIR=str(place))
    assert (done.returncode, done.stderr) == (0, "")
    whole(tmp_path / "out", expected)
    assert not [path for path in place.iterdir() if path.name.startswith("fmu_")]


PLAIN = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
class Plain(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.y = 3.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))
    def do_step(self, time, step):
        self.y += step
        return True
"""
STEPPED = """
import sys
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu
try:
    with Fmu(sys.argv[1]) as fmu:
        fmu.initialize()
        fmu.step(0.0, 0.5)
        print(*fmu.get("y"))
except FmuFailed as error:
    print(error)
"""


@pytest.mark.parametrize(("name", "answer"), [("für Übles, 50 %", "3.5\n"), ("%20", "set TMPDIR to a path without %20\n")])
def test_an_fmu_of_pythonfmus_own_library_does_so_too_or_says_why_not(tmp_path, name, answer):
    (tmp_path / "plain.py").write_text(PLAIN)
    program = "from pythonfmu import FmuBuilder; FmuBuilder.build_FMU('plain.py', dest='.')"  # in a process that forgets the module
    built = ran(cwd=tmp_path, call=(sys.executable, "-c", program), PYTHONSAFEPATH="")
    assert built.returncode == 0
    (tmp_path / name).mkdir()
    done = ran("Plain.fmu", cwd=tmp_path, call=(sys.executable, "-c", STEPPED), TMPDIR=str(tmp_path / name))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(answer)


def test_a_second_run_into_a_folder_is_refused_in_one_line(folder, tmp_path):
    first = begun(folder, tmp_path)
    for command in (tied(folder), ["export"]):
        second = ran(*command, "-o", tmp_path)
        assert (second.returncode, second.stdout, second.stderr.count("\n")) == (2, "", 1)
        assert f"--output = '{tmp_path}': another run is writing there" in second.stderr
    first.send_signal(signal.SIGINT)
    first.communicate()
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "interrupted"


def test_a_folder_is_free_again_however_its_holder_ended_and_what_it_was_making_goes(tmp_path):
    out = tmp_path / "a" / "out"
    program = "import os, sys; from master.process.folders import *; it = Path(sys.argv[1])\n"
    program += "with taken(it): (it / '.pipelay-1-x').mkdir(); os._exit(9)"
    assert ran(out, call=(sys.executable, "-c", program)).returncode == 9
    with taken(out):
        assert list(out.iterdir()) == []
    assert out.is_dir()  # it was there
    out.rmdir()
    with taken(out / "b"):
        pass
    assert not out.exists()


BROKEN = {  # interpreter of the FMUs, what happens to it, what is said
    "no interpreter": ("/absent/python", "", "Python /absent/python: No such file or directory (PIPELAY_PYTHON)"),
    "no Python": ("/bin/false", "", "Python /bin/false ended at its start, exit code 1 (PIPELAY_PYTHON)"),
    "a killed server": (sys.executable, "crash", "the FMU's Python has ended"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_an_interpreter_that_fails_the_fmus_is_one_line(kind, folder, tmp_path):
    python, fate, message = BROKEN[kind]
    change = ["--set", failing(fate), "--set", "simulation.duration=5"] if fate else []
    done = ran(*tied(folder, *change, "-o", tmp_path / "out"), PIPELAY_PYTHON=python)
    assert done.returncode == (1 if fate else 2)
    if not fate:
        assert done.stderr.startswith("pipelay: units.coil.fmu = 'spring.fmu': coil: cannot be loaded: ")
        assert message in done.stderr
        assert done.stderr.count("\n") == 1
        assert not (tmp_path / "out").exists()
    else:
        assert done.stderr == ""
        assert message in done.stdout
        assert columns(tmp_path / "out")["time"][-1] == pytest.approx(2.0)


INTERRUPTED = """
import os, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
sys.argv = ["pipelay", "scenes"]
from master.__main__ import program
sys.exit(program())
"""


@pytest.mark.parametrize("module", ["master.command_line", "argparse", "master.process.child", "master.commands", "tomllib"])
def test_ctrl_c_while_the_program_loads_is_one_line(module):
    done = ran("-c", INTERRUPTED.format(module=module), call=(sys.executable,))
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "pipelay: interrupted\n")


def test_a_process_ends_with_its_reader_and_so_do_those_that_it_has_started():
    child = "import subprocess, time; from master.fmi.runtime import end_with_reader; other = subprocess.Popen(['sleep', '60'])\n"
    child += "end_with_reader(1); print(other.pid, flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-P", "-c", child], stdout=subprocess.PIPE, text=True, start_new_session=True)
    other = int(process.stdout.readline())
    process.stdout.close()
    assert process.wait(20) == -signal.SIGKILL
    for _ in range(100):
        if not alive(other):
            break
        sleep(0.05)
    assert not alive(other)


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("python", ["", sys.executable], ids=["in its process", "in one of its own"])
def test_nothing_is_left_of_a_run_whose_processes_are_killed(folder, tmp_path, monkeypatch, python):
    monkeypatch.setenv("PIPELAY_PYTHON", python)
    run = begun(folder, tmp_path)
    left = [run.pid, *descendants(run.pid)]
    assert len(left) == (2 if not python else 4)  # the worker, and the servers of two FMUs
    for process in left[:2]:
        os.kill(process, signal.SIGKILL)
    run.wait()
    for _ in range(200):
        if not any(map(alive, left)):
            break
        sleep(0.05)
    assert not any(map(alive, left))


def descendants(process):
    found = []
    for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
        found += [int(child), *descendants(int(child))]
    return found


def test_the_cache_keeps_the_latest_used_of_each_kind_and_nothing_goes_that_was_used_just_now(tmp_path, monkeypatch):
    monkeypatch.setenv("PIPELAY_CACHE", str(tmp_path))
    monkeypatch.setattr(cache, "KEPT", {"fmus": (3, 60.0), "units": (1, 60.0)})
    fmus, units = cache_folder("fmus"), cache_folder("units")
    for age in range(6):
        for place in (fmus / f"old{age}.fmu", units / f"unit{age}"):
            place.mkdir() if place.parent == units else place.touch()
            os.utime(place, (1e9 - age, 1e9 - age))
    (units / "unit3" / "kernel").touch()
    os.utime(units / "unit3", (1e9, 1e9))
    os.utime(units / "unit0", (2e9, 2e9))  # used just now
    assert cache.used(fmus / "old5.fmu")
    monkeypatch.setattr(build, "build_fmu", lambda _, path: ZipFile(path, "w").close())
    made = cached_fmu(SPRING, fmus)
    assert sorted(path.name for path in fmus.iterdir()) == sorted(["old0.fmu", "old5.fmu", made.name])
    assert [path.name for path in units.iterdir()] == ["unit0"]
    before = made.stat().st_mtime_ns
    assert cached_fmu(SPRING, fmus) == made
    assert made.stat().st_mtime_ns > before
    monkeypatch.setattr(cache, "KEPT", {"fmus": (1, 60.0)})
    os.utime(fmus / "old0.fmu", (1e9, 1e9))
    workers = [threading.Thread(target=cache.bound) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert sorted(path.name for path in fmus.iterdir()) == sorted(["old5.fmu", made.name])


@pytest.mark.parametrize("which", ["stderr", "stdout"])
def test_what_takes_long_says_so_on_any_stream_that_is_a_terminal(monkeypatch, which, capsys):
    monkeypatch.setattr(screen, "SLOW", 0.01)
    with screen.patience(screen.terminal()):
        sleep(0.1)
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(getattr(sys, which), "isatty", lambda: True)
    with screen.patience(screen.terminal()):
        sleep(0.2)
    assert screen.COMPILING in getattr(capsys.readouterr(), which[3:])


def test_there_are_twelve_and_more():
    functions = [name for name in globals() if name.startswith("test_")]
    assert len(GOOD) + len(BROKEN) + len(functions) - 3 >= 25  # two of them are counted by their kinds, one is this
