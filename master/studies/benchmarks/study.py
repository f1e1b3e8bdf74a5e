"""The command `bench`: runs the cases asked for, writes tables and figures, and says which limits are kept."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from tqdm import tqdm

from master.studies.benchmarks import costs, coupled, forces, line, scaling, start, statics
from master.studies.benchmarks.precision import draw
from master.studies.stability.study import _verdict, _write

STATICS_REPEATS = 5
Tick = Callable[[], object]
Rows = list[dict[str, Any]]


class Limit(NamedTuple):
    """What is limited, what was found, and the limit, which is the least or the largest allowed."""

    what: str
    value: float
    limit: float
    least: bool = False

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.value >= self.limit if self.least else self.value <= self.limit

    def __str__(self) -> str:
        return f"  {self.what}: {self.value:.3g}, at {'least' if self.least else 'most'} {self.limit:g}: {_verdict(self.kept)}"


def _line(name: str, folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    rows, bound = line.sweep(line.CASES[name], tick)
    whole = [row for row in rows if row["simulated_s"] == line.CASES[name].duration]
    draw(folder / f"{name}.png", f"{name}: CPU time against error", whole, line.KEYS[0], "Position error, rms over time [m]", bound[0])
    words = [f"  uncertainty of the reference: {bound[0]:.1e} m, {bound[1]:.1e} N, {bound[2]:.1e} N m (rms)"]
    if missing := line.missing():
        words.append(f"  not installed, so left out: {', '.join(missing)} (pip install '.[bench]')")
    return rows, words, [Limit(*one, least=True) for one in line.verdicts(name, rows)]


def _heave(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    return _line("heave", folder, tick)


def _snap(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    return _line("snap", folder, tick)


def _paper(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    rows, bound, share = coupled.sweep(coupled.SETTINGS, tick)
    draw(folder / "paper.png", "paper: CPU time against error", rows, "largest_share", "Largest error, share of the change", share)
    words = [f"  uncertainty of the reference: {bound[0]:.1e} N, {bound[1]:.1e} N m, {bound[2]:.1e} m (rms), a share of {share:.1e}"]
    ratio, (best, speed) = coupled.verdicts(rows)
    limits = [
        Limit("CPU time, FMUs and master over both solved as one", ratio, coupled.LARGEST_RATIO),
        Limit(f"times real time within {coupled.LARGEST_SHARE:.0%} ({best})", speed, coupled.LEAST_SPEED, least=True),
    ]
    return rows, words, limits


def _statics(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    rows, bound = statics.sweep(STATICS_REPEATS, tick)
    draw(folder / "statics.png", "statics: CPU time against error", rows, "largest_share", "Largest error, share of its quantity", bound)
    return rows, [f"  uncertainty of the reference: a share of {bound:.1e}"], []


def _forces(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    return forces.sweep(forces.COUNTS, tick), [], []


def _costs(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    return costs.sweep(tick), [], []


def _nodes(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    rows = scaling.sweep(scaling.COUNTS, tick)
    return rows, [], [Limit(*one) for one in scaling.verdicts(rows)]


def _start(folder: Path, tick: Tick) -> tuple[Rows, list[str], list[Limit]]:
    rows = start.sweep(tick)
    return rows, [], [Limit(*one) for one in start.verdicts(rows)]


CASES: dict[str, Callable[[Path, Tick], tuple[Rows, list[str], list[Limit]]]] = {
    "heave": _heave, "snap": _snap, "paper": _paper, "statics": _statics, "forces": _forces, "costs": _costs, "nodes": _nodes,
    "start": _start,
}  # fmt: skip
ON_LINUX = ("nodes", "start")  # which ask the system for memory and for the time of processes that have ended
NAMES = tuple(name for name in CASES if sys.platform == "linux" or name not in ON_LINUX)


def study(names: Sequence[str], folder: Path, stream: TextIO) -> tuple[str, bool]:
    """Run the cases (all if none is named) and write CSV and PNG into `folder`; what to print, and whether all limits are kept.

    Progress goes to `stream` if it is a terminal. Raises RunError.
    """
    wanted = [name for name in NAMES if name in names] or list(NAMES)
    folder.mkdir(parents=True, exist_ok=True)
    lines, kept = [_machine(), "CPU time of the steps, once compiled; medians of interleaved repeats"], True
    with tqdm(file=stream, disable=not stream.isatty(), leave=False, unit=" runs") as progress:
        for name in wanted:
            progress.set_description(name)
            rows, words, limits = CASES[name](folder, progress.update)
            _write(folder / f"{name}.csv", rows)
            lines += ["", name, _table(rows), *words, *map(str, limits)]
            kept = kept and all(limit.kept for limit in limits)
    return "\n".join(lines), kept


def _machine() -> str:
    names = ("numpy", "scipy", "numba", "exudyn", "moordyn")
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}" + "".join(map(_version, names))


def _version(package: str) -> str:
    try:
        return f", {package} {version(package)}"
    except PackageNotFoundError:
        return ""


def _table(rows: Sequence[dict[str, Any]]) -> str:
    cells = [list(rows[0]), *([f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  " + "  ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True)) for row in cells)
