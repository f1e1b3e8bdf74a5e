"""What each command does; a function returns the exit code, or raises UsageError or RunError for one line on screen."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from master.errors import RunError, UsageError, broken_arithmetic
from master.fmi.system import EXPORTED, write_system
from master.process.folders import SCRATCH, taken, unwritable
from master.process.screen import complain, patience, say, terminal
from master.process.signals import postponed
from master.run.prepared import prepare
from master.scene import physics, reading, remarks


def run(options: argparse.Namespace) -> int:
    """Simulate a scene; exit code 1 where it did not reach its end or the energy check failed."""
    scene = reading.load(options.scene, options.changes)
    folder = _folder(run_folder(options))
    from master.run.simulate import simulate  # matplotlib and FMPy take a second to import: not for `scenes` or a bad scene

    result = simulate(scene, folder, terminal())
    say(f"{result.screen}\nresults in {folder}")
    return 0 if result.passed else 1


def run_folder(options: argparse.Namespace) -> Path:
    """Where the results of a run belong."""
    return options.output or Path("results") / Path(options.scene).stem


def statics(options: argparse.Namespace) -> int:
    """Print the coupled equilibrium of a scene."""
    scene = reading.of_pipe(reading.load(options.scene, options.changes))
    from master.with_units.statics_report import report  # works with the units' packages, which a run never imports

    with patience(terminal()), broken_arithmetic("statics"):
        found = report(scene)
        found["remarks"] = [*remarks.of(scene, at_rest=True).get("scene", []), *found["remarks"]]
        text = json.dumps(found, indent=2, allow_nan=False) if options.json else _statics_table(scene, found)
    say(text, result=True)
    return 0


def export(options: argparse.Namespace) -> int:
    """Write the FMUs of a scene, and the files that connect them, into a folder: all or none, instead of those of another export."""
    if options.python:
        _on_linux("--python")
    scene = reading.of_pipe(reading.load(options.scene, options.changes))
    folder = _folder(options.output)
    with taken(folder):
        try:
            unfinished = tempfile.TemporaryDirectory(prefix=SCRATCH, dir=folder)
        except OSError as error:
            raise unwritable(folder, error) from None
        with unfinished as place, patience(terminal()):
            fmus = prepare(scene, ["--export", place, *(["--python"] if options.python else [])])
            simulation = scene.sections.simulation
            joined = write_system(fmus, Path(place), simulation.macro_step, simulation.duration) if "vessel" in fmus else []
            written = _moved([*fmus.values(), *joined], folder)
    for path in written:
        say(str(path))
    for words in remarks.of(scene).get("scene", []):
        complain(f"remark: {words}", 0)
    return 0


def _moved(files: list[Path], folder: Path) -> list[Path]:
    """The files of an export in their `folder`, where none of another export stays. Raises RunError."""
    try:
        with postponed():
            written = [file.replace(folder / file.name) for file in files]
            for name in EXPORTED:
                if folder / name not in written:
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise RunError(f"{error.filename2 or error.filename}: cannot be replaced ({error.strerror})") from None
    return written


def scenes(options: argparse.Namespace) -> int:
    """List the built-in scenes."""
    found = reading.built_in()
    width = max(map(len, found))
    for name, title in found.items():
        say(f"{name:{width}}  {title}", result=True)
    say(f"files in {reading.BUILT_IN}", result=True)
    return 0


def keys(options: argparse.Namespace) -> int:
    """List what a scene may say."""
    from master.scene.keys import listing

    say(listing(), result=True)
    return 0


def stability(options: argparse.Namespace) -> int:
    """Run the stability cases; exit code 1 where a limit is not kept."""
    _on_linux("stability")
    return _study(options, "master.studies.stability.study")


def hard_cases(options: argparse.Namespace) -> int:
    """Run the pipe's hard cases; exit code 1 where a step does not keep the energy identity."""
    return _study(options, "master.studies.hard_cases")


def bench(options: argparse.Namespace) -> int:
    """Measure speed against error; exit code 1 where a limit is not kept."""
    return _study(options, "master.studies.benchmarks.study")


def _study(options: argparse.Namespace, module: str) -> int:
    """Run the cases of a module that has NAMES and `study`; it takes a second to import."""
    folder = _folder(options.output)
    cases = importlib.import_module(module)
    for name in options.cases:
        if name not in cases.NAMES:
            raise UsageError(f"case = {name!r}: must be one of {', '.join(map(repr, cases.NAMES))}")
    with taken(folder), patience(terminal()):
        text, kept = cases.study(options.cases, folder, terminal())
    say(f"{text}\ntables in {folder}")
    return 0 if kept else 1


def _on_linux(what: str) -> None:
    """Raise UsageError on other systems."""
    if sys.platform != "linux":
        raise UsageError(f"{what}: FMUs that are run by Python are for Linux only; all others are machine code")


def _folder(path: Path) -> Path:
    """`path`, if it is a folder or can become one. Raises UsageError."""
    try:
        for place in (path, *path.parents):
            if place.is_dir():
                return path
            if place.exists():
                raise UsageError(f"--output = {str(path)!r}: {place} is a file, not a folder")
            if place.is_symlink():
                raise UsageError(f"--output = {str(path)!r}: {place} is a link to nothing")
    except OSError as error:  # a name too long, a folder that may not be entered
        raise UsageError(f"--output = {str(path)!r}: cannot be written ({error.strerror})") from None
    return path


def _statics_table(scene: reading.Scene, found: dict[str, Any]) -> str:
    def kilo(key: str) -> str:
        return "  ".join(f"{value / 1e3:10.3f}" for value in found[key])

    touchdown, used = found["touchdown_s_m"], found["utilisation"]
    stress = f"{found['largest_von_mises_Pa'] / 1e6:.1f} MPa" + ("" if used is None else f", utilisation {used:.3f}")
    note = "" if found["stable"] else "; not stable: the line will leave it at the least push"
    return "\n".join(
        (
            f"Equilibrium of {scene.name}{note}: {scene.sections.title}",
            f"  physics         {physics.acting(scene)}",
            "on the pipe                  x           y           z",
            f"  top force     {kilo('top_force_e_N')}  kN",
            f"  top moment    {kilo('top_moment_e_N_m')}  kN m",
            f"  foot force    {kilo('foot_force_e_N')}  kN",
            f"  foot moment   {kilo('foot_moment_e_N_m')}  kN m",
            f"  top tension     {found['top_tension_N'] / 1e3:.3f} kN",
            f"  largest bending {found['largest_bending_moment_N_m'] / 1e3:.3f} kN m",
            f"  largest stress  {stress} (von Mises)",
            f"  stretch         {found['stretch_m']:.4f} m",
            f"  lowest point    {found['lowest_point_m']:.3f} m",
            f"  touchdown at    {'no seabed contact' if touchdown is None else f'S = {touchdown:.1f} m'}",
            *(f"  remark          {words}" for words in found["remarks"]),
        )
    )
