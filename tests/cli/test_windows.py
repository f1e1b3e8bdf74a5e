"""What only POSIX has: where the program names it, and that its commands run where Windows has nothing of the kind.

Nothing here was run on Windows: `windows_like/sitecustomize.py` hides from the program's own modules what Windows lacks.
"""

import ast
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import pytest
from windows_like.not_there import MISSING, MODULES

ROOT = Path(__file__).parents[2]
PACKAGES = ("master", "pipe_fmu", "vessel_fmu")
OTHERWISE = (
    "os.kill", "os.symlink", "os.link", "os.execv", "os.chmod", "os.umask", "symlink_to", "hardlink_to", "rename", "pass_fds",
    "preexec_fn",
)  # fmt: skip
"""What Windows has too, but with another meaning, or under conditions."""
PATH = re.compile(r"/[A-Za-z]+(/.*)?|~/.*|.*\.so(\.\w+)*")
NAMED = {f"{module}.{name}" for module, names in MISSING.items() for name in names} | {*MODULES, *OTHERWISE}
BY_PYTHON = "in FMUs that are run by Python, which are for Linux"
FORKED = "behind hasattr(os, 'fork')"
EXCEPTIONS = {
    "master/__main__.py": {"os.execv": "where os.name is posix"},
    "master/fmi/cache.py": {"rename": "into a new folder"},
    "master/fmi/entry.py": {
        "os.geteuid": "behind hasattr, getattr",
        "rename": "another process that was faster is no error",
    },
    "master/fmi/loader.py": dict.fromkeys(["loader.so", "loader.so.z", "loader_x.so.z"], BY_PYTHON),
    "master/fmi/runtime.py": dict.fromkeys(
        ["os.getpgrp", "os.killpg", "select.poll", "signal.SIGKILL"], f"{BY_PYTHON}; elsewhere called behind hasattr(select, 'poll')"
    ),
    "master/process/child.py": dict.fromkeys(["os.fork", "os.kill", "select.poll"], FORKED),
    "master/process/locks.py": {"fcntl": "where it can be imported"},
    "master/process/signals.py": dict.fromkeys(
        ["signal.pthread_sigmask", "signal.SIG_BLOCK", "signal.SIG_UNBLOCK"], f"{FORKED}, or behind that of its own name"
    ),
    "master/run/prepared.py": dict.fromkeys(["os.killpg", "signal.SIGKILL"], "behind hasattr(os, 'killpg')"),
    "master/studies/benchmarks/scaling.py": {"/proc/self/status": "a case that is there on Linux only"},
    "master/with_units/prepare.py": {"select.poll": "behind hasattr"},
    "master/fmi/warm.py": {"select.poll": "behind hasattr"},
}


def strings(tree):
    """The texts of a module that are no descriptions."""
    aside = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        match node:
            case ast.JoinedStr(values=parts):
                aside |= set(map(id, parts))
                yield "".join(str(part.value) if isinstance(part, ast.Constant) else "x" for part in parts)
            case ast.Constant(value=str(text)) if id(node) not in aside:
                yield text


def posix_only(source):
    """Names and texts in a module's source that Windows does not have, or not so."""
    tree, found = ast.parse(source), set()
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name(id=module), attr=name) if f"{module}.{name}" in NAMED:
                found.add(f"{module}.{name}")
            case ast.Attribute(attr=name) if name in NAMED:
                found.add(name)
            case ast.ImportFrom(module=module, names=names):
                found |= {f"{module}.{it.name}" for it in names} & NAMED | {str(module)} & NAMED
            case ast.Import(names=names):
                found |= {it.name for it in names} & NAMED
            case ast.keyword(arg=name) if name in NAMED:
                found.add(name)
            case ast.Call(func=ast.Name(id="hasattr" | "getattr"), args=[ast.Name(id=module), ast.Constant(value=name), *_]):
                found |= {f"{module}.{name}"} & NAMED
    return found | {text for text in strings(tree) if PATH.fullmatch(text)}


def sources():
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def test_every_posix_name_is_a_known_exception():
    found = {name: names for name, source in sources() if (names := posix_only(source))}
    assert found == {name: set(names) for name, names in EXCEPTIONS.items()}


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import os\nos.fork()", {"os.fork"}),
        ("from os import killpg", {"os.killpg"}),
        ("import fcntl", {"fcntl"}),
        ("hasattr(signal, 'SIGKILL')", {"signal.SIGKILL"}),
        ("open('/proc/self/maps')", {"/proc/self/maps"}),
        ("'''/proc/self/maps'''\nx = 'lib.so'", {"lib.so"}),
        ("Path(x).rename(y); Popen(pass_fds=(3,))", {"rename", "pass_fds"}),
        ("a = 'https://x/y', 'm/s', 'kN / m', '/'", set()),
    ],
)
def test_the_scan_finds_them(source, found):
    assert posix_only(source) == found


def like_windows(*command, code=0, **environment):
    """What a command prints where only that is there that Windows has."""
    given = os.environ | {"PYTHONPATH": str(ROOT / "tests" / "support" / "windows_like"), "PYTHONIOENCODING": "cp1252"} | environment
    call = [sys.executable, "-P", *map(str, command)]
    done = subprocess.run(call, env=given, capture_output=True, encoding="cp1252", timeout=580)
    assert done.returncode == code, done.stderr[-3000:]
    return done.stderr if code else done.stdout


def test_every_module_can_be_imported():
    names = [name.removesuffix(".py").replace("/", ".").removesuffix(".__init__") for name, _ in sources()]
    like_windows("-c", f"import importlib\nfor name in {names}: importlib.import_module(name)")


def test_it_sees_what_windows_has():
    program = "from master.process import child, locks, signals; print(hasattr(child.os, 'fork'))"
    assert like_windows("-c", program) == "True\n"  # seen from elsewhere
    program = 'import master.process.child as it; exec(\'print(hasattr(os, "fork"), hasattr(select, "poll"), os.name)\', vars(it))'
    assert like_windows("-c", program) == "False False nt\n"


@pytest.mark.parametrize("command", [["export", "--python"], ["stability"]])
def test_what_needs_linux_says_so_in_one_line(command, tmp_path):
    said = like_windows("-m", "master", *command, "-o", tmp_path / "out", code=2)
    words = "FMUs that are run by Python are for Linux only; all others are machine code"
    assert said == f"pipelay: {command[-1]}: {words}\n"


def test_a_case_that_needs_linux_is_none(tmp_path):
    said = like_windows("-m", "master", "bench", "start", "-o", tmp_path / "out", code=2)
    assert said.startswith("pipelay: case = 'start': must be one of 'heave',")


def test_statics_export_and_run(tmp_path):
    assert json.loads(like_windows("-m", "master", "statics", "heave", "--json"))["stable"]
    written = like_windows("-m", "master", "export", "-o", tmp_path / "fmus").split("\n")
    assert [Path(name).name for name in written[:2]] == ["pipe.fmu", "vessel.fmu"]
    said = like_windows("-m", "master", "run", "heave", "--set", "simulation.duration=1", "-o", tmp_path / "out")
    assert "energy check     passed" in said
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["status"] == "completed"
    assert "scenes" in like_windows("-m", "master", "--help")
    assert "environment.depth" in like_windows("-m", "master", "keys")


@pytest.mark.parametrize(("sign", "status"), [("", None), ("signals.csv", "interrupted")], ids=["while it is prepared", "on its way"])
def test_ctrl_c_ends_a_run_in_one_line_and_keeps_what_was_computed(sign, status, tmp_path):
    out, command = tmp_path / "out", [sys.executable, "-P", "-m", "master", "run", "heave", "--set", "simulation.duration=1e5"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tests" / "support" / "windows_like")}
    run = subprocess.Popen([*command, "-o", out], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (out / sign).exists():
        assert run.poll() is None
        sleep(0.05)
    sleep(0.5)
    run.send_signal(signal.SIGINT)
    said, error = run.communicate(timeout=60)
    assert run.returncode == 1
    if status is None:
        assert (said, error) == ("", "pipelay: interrupted\n")
        assert not out.exists()
    else:
        assert error == ""
        assert json.loads((out / "summary.json").read_text())["status"] == status
