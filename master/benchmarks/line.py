"""The pipe alone with a heaving top: CPU time against error, for elements and steps, against a converged run of its own.

Errors are root mean squares over the common instants: position at L/4, L/2 and 3L/4, force at the top, largest bending moment. The force
at an instant is the mean of the steps before and after it. The reference's uncertainty is taken as its own distance from the finest run of
the sweep on its kind of mesh, which is larger wherever the error at least halves with the spacing and the step.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.interpolate import CubicHermiteSpline

from master.errors import RunError
from master.figures import _figure
from master.hard_cases import Motion, cases, swing
from pipe_fmu import Pipe
from pipe_fmu.so3 import matrix

SAMPLE = 0.4  # s between the instants compared
_PIPE = next(case.pipe for case in cases() if case.name == "snap, slack to taut")


@dataclass(frozen=True)
class Setting:
    """Elements, step [s] and kind of mesh of one run."""

    elements: int
    step_s: float
    mesh: str = "adapted"


@dataclass(frozen=True)
class LineCase:
    """A motion of the top, the runs to compare (the finest last) and the run they are compared with."""

    motion: Motion
    duration: float
    settings: tuple[Setting, ...]
    reference: Setting
    repeats: int = 3


@dataclass(frozen=True)
class Histories:
    """What is compared, at the instants: position (k, 3, 3) [m], top force (k, 3) [N], largest bending moment (k,) [N m]."""

    position: np.ndarray
    top_force: np.ndarray
    bending: np.ndarray

    def distance(self, other: Histories) -> tuple[float, float, float]:
        """Root mean square differences in position [m], top force [N] and largest bending moment [N m]."""
        rows = (self.position - other.position, self.top_force - other.top_force, self.bending - other.bending)
        position, force = (float(np.sqrt((row**2).sum(axis=-1).mean())) for row in rows[:2])
        return position, force, float(np.sqrt((rows[2] ** 2).mean()))


_SWEEP = (
    *(Setting(n, h) for n, h in ((24, 0.4), (24, 0.2), (48, 0.2), (48, 0.1), (96, 0.1), (96, 0.05))),
    *(Setting(n, h, "uniform") for n, h in ((48, 0.1), (96, 0.05))),
)
CASES = {
    "heave": LineCase(swing(2.0, 12.0), 300.0, _SWEEP, Setting(192, 0.025)),
    "snap": LineCase(swing(6.0, 8.0), 60.0, _SWEEP, Setting(192, 0.0125)),
}


def run(case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """CPU time of the steps [s] (statics, compilation and evaluation outside the clock) and the histories. Raises RunError."""
    pipe = Pipe(replace(_PIPE, nodes=setting.elements + 1, mesh="uniform" if setting.mesh == "uniform" else _PIPE.mesh))
    found, state = pipe.start(0.0)
    if not found.converged:
        raise RunError(f"statics with {setting.elements} elements failed, residual {found.residual:.1e}")
    h, still, motion = setting.step_s, np.zeros(3), case.motion
    every = round(SAMPLE / h)
    pipe.step(state, still, still, h)  # compiles what is not yet compiled
    kept, forces = [], []
    begin = time.process_time()
    for k in range(round(case.duration / h)):
        result = pipe.step(state._replace(time=k * h), (motion((k + 1) * h)[0] - motion(k * h)[0]) / h, still, h)
        if not result.converged:
            raise RunError(f"{setting.elements} elements, step {h:g} s: no convergence at {k * h:g} s, residual {result.residual:.1e}")
        state = result.state
        forces.append(result.top[:3])
        if (k + 1) % every == 0:
            kept.append(state)
    spent = time.process_time() - begin
    top = np.array(forces)
    at = np.arange(every, len(top), every)
    kept = kept[: len(at)]
    bending = [pipe.largest_bending_moment(pipe.section_forces(state)) for state in kept]
    quarters = np.array([_quarters(pipe, state.position, state.quaternion) for state in kept])
    return spent, Histories(quarters, 0.5 * (top[at - 1] + top[at]), np.array(bending))


def _quarters(pipe: Pipe, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Positions (3, 3) at L/4, L/2 and 3L/4, by Hermite's cubic along the first axes of the sections."""
    along = np.array([np.array(matrix(tuple(q)))[:, 0] for q in quaternion])
    curve = CubicHermiteSpline(pipe.s, position, along)
    return np.asarray(curve(pipe.s[-1] * np.array([0.25, 0.5, 0.75])))


def sweep(case: LineCase, tick: Callable[[], object]) -> tuple[list[dict[str, Any]], tuple[float, float, float]]:
    """A row for every run, CPU times the medians of interleaved repeats; and the uncertainty of the reference. Raises RunError."""
    _, exact = run(case, case.reference)
    tick()
    spent: dict[Setting, list[float]] = {setting: [] for setting in case.settings}
    found: dict[Setting, Histories] = {}
    for _ in range(case.repeats):
        for setting in case.settings:
            seconds, found[setting] = run(case, setting)
            spent[setting].append(seconds)
            tick()
    errors = {setting: found[setting].distance(exact) for setting in case.settings}
    keys = ("position_rms_m", "top_force_rms_N", "bending_rms_N_m")
    rows = [
        {"contestant": f"step, {s.mesh} mesh", **asdict(s), "cpu_s": statistics.median(spent[s]), **dict(zip(keys, errors[s], strict=True))}
        for s in case.settings
    ]
    finest = min(case.settings, key=lambda s: (-s.elements, s.step_s, s.mesh != case.reference.mesh))
    return rows, errors[finest]


def draw(path: Path, name: str, rows: list[dict[str, Any]], uncertainty: float) -> None:
    """Work-precision figure: CPU time against position error, one line per contestant."""
    looks = (("-", "o"), ("--", "s"), (":", "^"))
    with _figure(path, f"{name}: CPU time against error", (5.6, 4.0)) as figure:
        axes: Axes = figure.subplots()
        for (line, marker), one in zip(looks, dict.fromkeys(row["contestant"] for row in rows), strict=False):
            mine = sorted((row["position_rms_m"], row["cpu_s"]) for row in rows if row["contestant"] == one)
            axes.loglog(*zip(*mine, strict=True), color="#161616", linestyle=line, marker=marker, markerfacecolor="white", label=one)
        axes.axvline(uncertainty, color="#8a8a8a", linewidth=1.0, linestyle="-.", label="uncertainty of the reference")
        axes.set(xlabel="Position error, rms over time [m]", ylabel="CPU time [s]")
        axes.legend()
