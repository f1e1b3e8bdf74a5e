"""What can still be done for a run whose process died: a summary that says how and when, the figure of its energies."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

from master.process.child import Death
from master.process.folders import SCRATCH
from master.results import figures
from master.results.recorder import Table
from master.results.report import write_summary


def place_holder(scene: str, process: int, kinds: dict[str, str]) -> dict[str, Any]:
    """What summary.json says until the run ends; `kinds` are those of the ledger."""
    message = "the process ended within the run, as it does where an FMU crashes; signals.csv has every step before"
    return {"scene": scene, "status": "died", "message": message, "process": process, "energy_columns": kinds}


def scratch_prefix(process: int) -> str:
    """Beginning of the name of the folder in which a process makes its results, in that of the results."""
    return f"{SCRATCH}{process}-"


def bury(folder: Path, death: Death, status: str = "died") -> str:
    """Finish the results that a process left in `folder` before its end; when it ended and where they are, empty if it left none."""
    for left in folder.glob(scratch_prefix(death.process) + "*"):
        shutil.rmtree(left, ignore_errors=True)
    try:
        found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        table = Table.read(folder / "signals.csv")
    except (OSError, ValueError):
        return ""
    if found.get("process") != death.process:  # of an earlier run
        return ""
    kinds = found.pop("energy_columns")
    time = float(table.column("time")[-1])
    found |= {
        "status": status,
        "message": f"the process {death.how} at t = {time:g} s",
        "duration_s": time,
        "exchanged_energy_J": float(table.column("exchanged")[-1]),
        "interface_residual_J": float(table.column("interface_residual_sum")[-1]),
        "ledger_closure_J": float(abs(table.column("closure")).max()),
    }
    signals = folder / "signals.csv"
    with suppress(OSError):  # of a full disk
        os.truncate(signals, signals.read_bytes().rfind(b"\n") + 1)  # within whose last line it may have ended
        write_summary(folder / "summary.json", found)
        figures.draw_all(folder, table, None, (), kinds)
    return f" at t = {time:g} s; results so far in {folder}"
