"""The command line. Imports what a command needs only once it runs, see `master.process.child`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from master.errors import RunError, UsageError
from master.fmi.failure import visible
from master.process.child import guarded
from master.process.screen import complain, drop, secure_streams
from master.process.signals import breakable

EPILOG = """examples:
  pipelay run                                  the paper's scene, 300 s; results in results/paper
  pipelay run pipelay -o out                   the same with the seabed under the pipe
  pipelay run --set simulation.duration=60 --set vessel.controller.x=790
  pipelay run my-scene.toml                    a scene of your own; start from a copy of a built-in one
  pipelay statics paper --json                 the equilibrium alone, as JSON
  pipelay export -o fmus --scene pipelay       pipe.fmu and vessel.fmu for any FMI 2.0 master
  pipelay scenes                               what is built in
  pipelay keys                                 what a scene may say

exit codes: 0 done and the energy check kept; 1 the computation failed, the energy check did, or results cannot be written;
2 a mistake in the call or the scene, named in one line."""


class _Parser(argparse.ArgumentParser):
    """One that bears streams that are full or closed, and sends no control characters to them."""

    def error(self, message: str) -> NoReturn:
        super().error(visible(message))

    def _print_message(self, message: str, file: Any = None) -> None:
        stream = file or sys.stderr
        try:
            stream.write(message)
            stream.flush()
        except OSError:
            drop(stream)


class _Command(NamedTuple):
    """What `--help` says of a command, and what adds its options."""

    short: str
    epilog: str
    options: Callable[[argparse.ArgumentParser], None] = lambda to: None


def parser() -> argparse.ArgumentParser:
    """The commands and their options."""
    raw = argparse.RawDescriptionHelpFormatter
    about = "A geometrically exact offshore pipe and its vessel as two FMUs, coupled with an energy-checked master."
    top = _Parser("pipelay", description=about, epilog=EPILOG, formatter_class=raw)
    subparsers = top.add_subparsers(metavar="COMMAND", required=True)
    for name, (short, epilog, options) in _COMMANDS.items():
        added = subparsers.add_parser(name, help=short, description=short, epilog=epilog, formatter_class=raw)
        added.set_defaults(command=name.replace("-", "_"))  # a function of `master.commands`
        options(added)
    return top


def _run_options(to: argparse.ArgumentParser) -> None:
    _scene_arguments(to, optional=True)
    to.add_argument("-o", "--output", metavar="DIR", type=Path, help="folder of the results (default: results/SCENE)")


def _statics_options(to: argparse.ArgumentParser) -> None:
    _scene_arguments(to, optional=False)
    to.add_argument("--json", action="store_true", help="print JSON, with arrays over the nodes")


def _export_options(to: argparse.ArgumentParser) -> None:
    to.add_argument("--scene", default="paper", metavar="SCENE", help="scene the FMUs belong to (default: paper)")
    _set_argument(to)
    to.add_argument("-o", "--output", metavar="DIR", type=Path, default=Path(), help="folder (default: here)")
    python = "make FMUs that are run by a Python with numpy and numba on the machine (Linux), not machine code: for changed models"
    to.add_argument("--python", action="store_true", help=python)


def _scene_arguments(to: argparse.ArgumentParser, *, optional: bool) -> None:
    short = "a built-in name (see `pipelay scenes`) or a .toml file"
    if optional:
        to.add_argument("scene", nargs="?", default="paper", metavar="SCENE", help=f"{short} (default: paper)")
    else:
        to.add_argument("scene", metavar="SCENE", help=short)
    _set_argument(to)


def _study_arguments(to: argparse.ArgumentParser, cases: str) -> None:
    to.add_argument("cases", nargs="*", metavar="CASE", help=f"{cases} (default: all)")
    folder = Path("results") / to.prog.split()[-1]
    to.add_argument("-o", "--output", metavar="DIR", type=Path, default=folder, help="folder of the tables")


def _set_argument(to: argparse.ArgumentParser) -> None:
    about = "change one value of the scene: dotted key, TOML value; may be repeated"
    to.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes", help=about)


_COMMANDS = {
    "run": _Command(
        "Simulate a scene; write signals, shapes, figures and a summary.",
        "files written: signals.csv, shapes.npz, fig3_*.png to fig9_*.png, energy.png, summary.json\n\n"
        "Ctrl-C ends a run early and keeps what was computed.",
        _run_options,
    ),
    "statics": _Command(
        "Find the static equilibrium of a scene and print its forces.",
        "Forces and moments act on the pipe; components are x forward, y starboard, z down.",
        _statics_options,
    ),
    "export": _Command(
        "Write the units of a scene as FMUs (FMI 2.0 co-simulation).",
        "The equilibrium of the scene is built in as the start of both FMUs.",
        _export_options,
    ),
    "scenes": _Command(
        "List the built-in scenes.",
        "Copy one of their files for a scene of your own; `pipelay keys` lists what it may say.",
    ),
    "keys": _Command(
        "List what a scene of pipe and vessel may say: keys, defaults, units.",
        "Lists of tables have [] behind their names; defaults in brackets act only where their table stands in the scene.",
    ),
    "stability": _Command(
        "Run the coupling's stability cases; write their tables and a stability map.",
        "files written: published.csv, limits.csv, stability_map.csv, stability_map.png, bodies.csv; all of it takes about ten minutes",
        partial(_study_arguments, cases="oscillator, schueller, quarter-car, manipulator, limits, bodies"),
    ),
    "hard-cases": _Command(
        "Run the pipe alone where simulations of lines fail, each case at three steps.",
        "file written: hard-cases.csv; all of it takes ten seconds once compiled",
        partial(_study_arguments, cases="the cases by their names"),
    ),
    "bench": _Command(
        "Measure CPU time against error, beside other codes; costs of nodes, of physics and of the start.",
        "files written: CASE.csv, and CASE.png where error is measured; all of it takes half an hour",
        partial(_study_arguments, cases="heave, snap, paper, statics, forces, costs, nodes, start"),
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; mistakes and failures become one line on the error stream."""
    return _perform(parser().parse_args(arguments))


def program() -> int:
    """`main` for the shell, in a process of its own: even where that dies a line on the error stream says so, with exit code 1."""
    secure_streams()
    options = parser().parse_args()
    ended = guarded(lambda: _perform(options))
    if isinstance(ended, int):
        return ended
    from master import commands
    from master.process import crash

    left = crash.bury(commands.run_folder(options), ended) if options.command == "run" else ""
    return complain(f"the process {ended.how}{left}", 1)


def _perform(options: argparse.Namespace) -> int:
    os.environ.pop("NUMBA_DISABLE_JIT", None)  # the kernels can only run compiled
    os.environ["PYTHONSAFEPATH"] = "1"  # no process of ours takes modules of the working folder
    try:
        with breakable():
            from master import commands

            return int(getattr(commands, options.command)(options))
    except UsageError as error:
        return complain(str(error), 2)
    except RunError as error:
        return complain(str(error), 1)
    except KeyboardInterrupt:
        return complain("interrupted", 1)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        return 1
    except OSError as error:  # a full disk, a file where a folder should be, a file that may not be written
        return complain(": ".join(filter(None, (error.filename and str(error.filename), error.strerror or str(error)))), 1)
    except MemoryError:
        return complain("not enough memory for this scene", 1)
