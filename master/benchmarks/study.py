"""The command `bench`: runs the cases asked for, writes tables and figures, and says which limits are kept."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numba
import numpy as np
import scipy
from tqdm import tqdm

from master.benchmarks import line, scaling
from master.stability.study import _verdict, _write

NAMES = (*line.CASES, "nodes")


def study(names: Sequence[str], folder: Path, stream: TextIO) -> tuple[str, bool]:
    """Run the cases (all if none is named) and write CSV and PNG into `folder`; what to print, and whether all limits are kept.

    Progress goes to `stream` if it is a terminal. Raises RunError.
    """
    wanted = [name for name in NAMES if name in names] or list(NAMES)
    folder.mkdir(parents=True, exist_ok=True)
    lines, kept = [_machine(), "CPU time of the steps, once compiled; medians of interleaved repeats"], []
    runs = {name: 1 + case.repeats * len(case.settings) for name, case in line.CASES.items()} | {"nodes": len(scaling.COUNTS)}
    with tqdm(total=sum(runs[name] for name in wanted), file=stream, disable=not stream.isatty(), leave=False, unit="run") as progress:
        for name in wanted:
            progress.set_description(name)
            if name == "nodes":
                rows = scaling.sweep(scaling.COUNTS, progress.update)
                found = scaling.verdicts(rows)
                lines += ["", name, _table(rows)]
                lines += [f"  {what}: {value:.3g}, at most {limit:g}: {_verdict(value <= limit)}" for what, value, limit in found]
                kept += [value <= limit for _, value, limit in found]
            else:
                rows, bound = line.sweep(line.CASES[name], progress.update)
                lines += ["", name, _table(rows)]
                lines += [f"  uncertainty of the reference: {bound[0]:.1e} m, {bound[1]:.1e} N, {bound[2]:.1e} N m (rms)"]
                line.draw(folder / f"{name}.png", name, rows, bound[0])
            _write(folder / f"{name}.csv", rows)
    return "\n".join(lines), all(kept)


def _machine() -> str:
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, numba {numba.__version__}"
    return f"{platform.machine()}, {versions}"


def _table(rows: Sequence[dict[str, Any]]) -> str:
    cells = [list(rows[0]), *([f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  " + "  ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True)) for row in cells)
