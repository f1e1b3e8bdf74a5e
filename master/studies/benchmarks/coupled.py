"""The paper's scene: pipe and vessel through their FMUs and the master, and both solved together in-process (master.with_units.monolithic).

Errors are root mean squares over the instants of force and moment on the pipe's top and of the vessel's position, against a finer
monolithic run; its uncertainty is its distance from one with half the elements and twice the step. A share is an error over the largest
change of its quantity since the start. Only the stepping is timed; every run has a process of its own, in turn.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from master.errors import RunError
from master.scene import reading
from master.studies.benchmarks.through_fmus import apart, march

DURATION, SAMPLE = 300.0, 2.0  # s
MONOLITHIC, CONSISTENT, RECORDED = "monolithic", "energy-consistent", "energy-consistent, recorded"
LARGEST_RATIO = 1.0  # of CPU times, FMUs and master over monolithic
LARGEST_SHARE, LEAST_SPEED = 0.01, 100.0  # error, and how many times faster than real time with it
KEYS = ("top_force_rms_N", "top_moment_rms_N_m", "vessel_rms_m")
_PORTS = (("pipe", "end_force"), ("pipe", "end_moment"), ("vessel", "position"))


@dataclass(frozen=True)
class Setting:
    """Coupling scheme (or how else the two are solved), nodes, macro step [s], and how often it is timed."""

    contestant: str
    nodes: int
    step_s: float
    repeats: int = 1


OWN = Setting(CONSISTENT, 48, 0.1, 5)  # what the scene itself says
SETTINGS = (
    OWN,
    Setting(MONOLITHIC, 48, 0.1, 5),
    Setting(RECORDED, 48, 0.1, 3),
    *(Setting(CONSISTENT, n, h) for n, h in ((12, 1.0), (12, 0.5), (24, 0.5), (24, 0.2), (48, 0.2), (48, 0.05), (96, 0.05))),
    *(Setting(MONOLITHIC, n, h) for n, h in ((12, 1.0), (24, 0.2), (96, 0.05))),
    *(Setting(scheme, 48, h) for scheme in ("serial", "parallel") for h in (0.2, 0.1, 0.05)),
)
REFERENCE, CHECK = Setting(MONOLITHIC, 192, 0.05), Setting(MONOLITHIC, 96, 0.1)

Histories = tuple[np.ndarray, np.ndarray, np.ndarray]
Triple = tuple[float, float, float]


def run(setting: Setting) -> tuple[float, Histories]:
    """CPU time [s] of the steps; top force [N], top moment [N m] and vessel position [m], (k, 3) each. Raises RunError."""
    times = np.arange(SAMPLE, DURATION + 0.5 * SAMPLE, SAMPLE)
    changes = [f"pipe.nodes={setting.nodes}", f"simulation.macro_step={setting.step_s!r}"]
    if setting.contestant == MONOLITHIC:
        spent, found = apart(_monolithic, changes, times)
    else:
        scheme = CONSISTENT if setting.contestant == RECORDED else setting.contestant
        changes += [f"coupling.scheme='{scheme}'", "coupling.on_violation='warn'"]
        spent, found = apart(march, "paper", changes, times, _PORTS, setting.contestant == RECORDED)
        found = [-found[0], -found[1], found[2]]  # the pipe's ports carry its pull
    return spent, tuple(found)


def _monolithic(changes: Sequence[str], times: np.ndarray) -> tuple[float, list[np.ndarray]]:
    """As `march`, of both solved as one."""
    from master.with_units import monolithic

    pipe, vessel, moments = monolithic.march(reading.load("paper", [*changes, f"simulation.duration={float(times[-1])!r}"]))
    next(moments)
    found, spent = [], 0.0
    for t in times.tolist():
        begin = time.process_time()
        moment = next(moment for moment in moments if moment.time > t - 1e-9)
        spent += time.process_time() - begin
        forces = pipe.section_forces(moment.pipe)
        top = pipe.spatial(moment.pipe, forces, -1)
        found.append((top[:3], top[3:], vessel.position(moment.vessel)))
    return spent, [np.array(values) for values in zip(*found, strict=True)]


def distance(one: Histories, other: Histories) -> Triple:
    """Root mean square differences of force, moment and position."""
    force, moment, position = (float(np.sqrt(((a - b) ** 2).sum(axis=1).mean())) for a, b in zip(one, other, strict=True))
    return force, moment, position


def sweep(settings: Iterable[Setting], tick: Callable[[], object]) -> tuple[list[dict[str, Any]], Triple, float]:
    """A row for every run, the reference's uncertainty, and that as a share. A run that fails has NaN for errors. Raises RunError."""
    exact, wanted = run(REFERENCE)[1], list(settings)
    tick()
    uncertainty = distance(run(CHECK)[1], exact)
    tick()
    change = tuple(float(np.linalg.norm(values - values[0], axis=1).max()) for values in exact)
    spent: dict[Setting, list[float]] = {setting: [] for setting in wanted}
    errors: dict[Setting, Triple] = {}
    for turn in range(max(setting.repeats for setting in wanted)):
        for setting in wanted:
            if turn < setting.repeats:
                try:
                    seconds, found = run(setting)
                    errors[setting] = distance(found, exact)
                except RunError:  # the explicit schemes may break down, which is a result
                    seconds, errors[setting] = np.nan, (np.nan, np.nan, np.nan)
                spent[setting].append(seconds)
                tick()
    rows = []
    for s in wanted:
        cpu = statistics.median(spent[s])
        row = {"contestant": s.contestant, "nodes": s.nodes, "step_s": s.step_s, "repeats": s.repeats, "cpu_s": cpu}
        row |= dict(zip(KEYS, errors[s], strict=True))
        rows.append(row | {"largest_share": _share(errors[s], change), "times_real_time": DURATION / cpu})
    return rows, uncertainty, _share(uncertainty, change)


def _share(errors: Triple, change: Iterable[float]) -> float:
    return float(np.max([error / whole for error, whole in zip(errors, change, strict=True)]))


def verdicts(rows: Sequence[dict[str, Any]]) -> tuple[float, tuple[str, float]]:
    """The CPU ratio at the scene's own nodes and step; the fastest run through the FMUs within LARGEST_SHARE and its times real time."""
    cpu = {(row["contestant"], row["nodes"], row["step_s"]): row["cpu_s"] for row in rows}
    ratio = cpu[CONSISTENT, OWN.nodes, OWN.step_s] / cpu[MONOLITHIC, OWN.nodes, OWN.step_s]
    able = [row for row in rows if row["contestant"] == CONSISTENT and row["largest_share"] <= LARGEST_SHARE]
    best = max(able, key=lambda row: row["times_real_time"], default=None)
    if best is None:
        return ratio, ("no run through the FMUs", 0.0)
    return ratio, (f"{best['nodes']} nodes, {best['step_s']:g} s, error {best['largest_share']:.1%}", best["times_real_time"])
