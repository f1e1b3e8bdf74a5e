"""A run from the scene to the files: prepare, load the FMUs, step to the end, write what was recorded.

Whatever ends a run early, a failed step, a broken energy balance or Ctrl-C, the results up to there are written. The signals
are written as they come, and a summary that is replaced at the end says that the process died: even where an FMU takes the process
with it, signals.csv has every step before.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from master.coupling.ledger import EnergyCheckFailed
from master.errors import RunError
from master.process import crash
from master.process.child import Death
from master.process.folders import taken, unwritable
from master.process.screen import patience
from master.process.signals import postponed
from master.results import figures, report
from master.results.recorder import SIGNALS, Recorder, Signal
from master.run.drive import Drive
from master.run.pipe_drive import open_drive
from master.run.prepared import prepare
from master.run.two_fmu_drive import open_bonded, signals
from master.scene import physics, remarks
from master.scene.reading import Scene
from master.scene.two_fmus import General

OWN_FILES = ("signals.csv", "shapes.npz", "summary.json", "energy.png", "fig[3-9]_*.png")


@dataclass(frozen=True)
class Result:
    """The end of a run: whether it reached its end with the energy check kept, its summary, the screen table."""

    passed: bool
    summary: dict[str, Any]
    screen: str


@dataclass(frozen=True)
class Ending:
    """How the stepping ended: completed, stopped by the energy check, failed or interrupted."""

    status: str
    message: str = ""


def simulate(scene: Scene, folder: Path, screen: TextIO) -> Result:
    """Run a scene and leave its results in `folder`; progress goes to `screen`, to a terminal only.

    Raises UsageError where the scene or the folder cannot be used, RunError where the run could not even start.
    """
    with taken(folder):
        try:
            unfinished = tempfile.TemporaryDirectory(prefix=crash.scratch_prefix(os.getpid()), dir=folder)
        except OSError as error:
            raise unwritable(folder, error) from None
        with unfinished as scratch:
            try:
                return _simulated(scene, folder, Path(scratch), screen)
            except OSError as error:  # a full disk, or a folder that is gone
                how = f"could not write {error.filename or 'its results'} ({error.strerror or error})"
                left = crash.bury(folder, Death(how, os.getpid()), "failed")
                raise RunError(f"the process {how}{left}") from None


def _simulated(scene: Scene, folder: Path, scratch: Path, screen: TextIO) -> Result:
    """Run a scene; the files that are made at its end are made in `scratch`. Raises as `simulate`, and OSError."""
    with ExitStack() as stack:
        begun = time.perf_counter()
        calm = stack.enter_context(patience(screen))
        try:
            simulation, drive, kept = scene.sections.simulation, *_open(scene, stack)
        except OSError as error:
            raise RunError(f"the units cannot be opened: {error}") from None
        _clear(folder)
        report.write_summary(folder / "summary.json", crash.place_holder(scene.name, os.getpid(), drive.ledger.kinds))
        stream = stack.enter_context((folder / "signals.csv").open("w", encoding="utf-8"))
        every = None if isinstance(scene.sections, General) else simulation.recorded_every
        recorder = Recorder(drive.units, every, simulation.snapshots, kept, stream)
        started = time.perf_counter()
        ending = _march(drive, recorder, scene, screen, calm)
        wall = {"wall_s": time.perf_counter() - started, "preparation_s": started - begun}
        if ending.status in ("completed", "interrupted"):  # else the FMUs may stand within a step
            recorder.record_shape(drive.time)
        account: dict[str, Any] = {"coupling": drive.scheme, "physics": physics.acting(scene)}
        account |= {"start_remarks": remarks.of(scene) | drive.remarks.start, "remarks": drive.remarks.summary()}
        account |= {**_facts(drive), **asdict(ending), **asdict(drive.cost), **wall}
        account |= drive.ledger.summary()
        account |= {"energy_check_passed": ending.status != "stopped" and not drive.ledger.complaint}
        account |= {"energy_check": ending.message if ending.status == "stopped" else drive.ledger.verdict()}
        result = _write(scene, recorder, account, scratch, drive.ledger.kinds)
    _move_into_place(scratch, folder)
    return result


def _march(drive: Drive, recorder: Recorder, scene: Scene, stream: TextIO, calm: Callable[[], None]) -> Ending:
    """Step to the end, recording after every step; the first one may compile, after it `calm` is called."""
    end = scene.sections.simulation.duration
    recorder.sample(drive.time, row(drive))
    with postponed() as interrupted, _progress(end, stream) as bar:
        while drive.time < end:
            before = drive.time
            try:
                drive.advance(end)
            except EnergyCheckFailed as error:
                return Ending("stopped", str(error))
            except RunError as error:
                return Ending("failed", str(error))
            calm()
            recorder.sample(drive.time, row(drive))
            bar.update(drive.time - before)
            if interrupted.is_set():
                return Ending("interrupted", f"interrupted at {drive.time:g} s of {end:g} s")
    return Ending("completed")


def row(drive: Drive) -> dict[tuple[str, str], float]:
    """What is recorded beside the ports: the derived values and the ledger."""
    return drive.derived() | {(name, "J"): value for name, value in zip(drive.ledger.names, drive.ledger.row, strict=True)}


def _open(scene: Scene, stack: ExitStack) -> tuple[Drive, Sequence[Signal]]:
    """The units of a scene, initialised, and the signals to keep."""
    if isinstance(scene.sections, General):
        units = stack.enter_context(open_bonded(scene.sections))
        return units, signals(scene.sections, units.units)
    return stack.enter_context(open_drive(scene.sections, prepare(scene))), SIGNALS


def _facts(drive: Drive) -> dict[str, float]:
    """What the report needs of the units beside the signals."""
    pipe = drive.units.get("pipe")
    return {"unstretched_length_m": float(pipe.get("s")[-1])} if pipe is not None and "s" in pipe.ports else {}


def _write(scene: Scene, recorder: Recorder, account: dict[str, Any], folder: Path, kinds: dict[str, str]) -> Result:
    """Write every file of the results into `folder`."""
    table, shapes = recorder.table(), recorder.shapes()
    summary = report.summarise({"scene": scene.name, **account}, table)
    if shapes is not None:
        shapes.write(folder / "shapes.npz")
    instants = [t for t in scene.sections.simulation.snapshots if t <= table.column("time")[-1]]
    figures.draw_all(folder, table, shapes, instants, kinds)
    report.write_summary(folder / "summary.json", summary)
    passed = summary["status"] == "completed" and summary["energy_check_passed"]
    return Result(passed, summary, report.screen(summary, scene.sections.title))


def _clear(folder: Path) -> None:
    """Remove the results of an earlier run from the folder; other files there stay."""
    for pattern in OWN_FILES:
        for old in folder.glob(pattern):
            old.unlink()


def _move_into_place(scratch: Path, folder: Path) -> None:
    """The finished files join the signals."""
    for new in sorted(scratch.iterdir()):
        new.replace(folder / new.name)


def _progress(end: float, stream: TextIO) -> Any:
    """A bar over simulated time; nothing where `stream` is no terminal."""
    style = "{percentage:3.0f}%|{bar}| {n:.1f} of {total:.1f} s simulated, {remaining} left"
    return tqdm(total=end, file=stream, disable=not stream.isatty(), bar_format=style, leave=False)
