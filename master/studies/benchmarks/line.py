"""The pipe alone with a heaving top: CPU time against error, of our step and of others on the same physics.

Errors are distances from a converged run of ours, root mean squares over the common instants: position at L/4, L/2 and 3L/4, force at the
top, largest bending moment. Where a contestant's force is the mean over a step, that at an instant is the mean of the steps before and
after it. The reference's uncertainty is taken as its own distance from a run of ours with half the elements and twice the step, which is
larger than it wherever the error at least halves with both.
"""

from __future__ import annotations

import importlib.util
import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from master.errors import RunError
from master.studies.benchmarks import own_step, paper_method, peer_exudyn, peer_moordyn
from master.studies.benchmarks.histories import Histories, LineCase, Setting
from master.studies.hard_cases import cases, swing

PIPE = replace(next(case.pipe for case in cases() if case.name == "snap, slack to taut"), nodes=49, top_amplitude=2.0)
OWN, UNIFORM, FMU = "step", "step, uniform mesh", "FMU and master"
EXUDYN, BARE, MOORDYN, PAPER = "Exudyn ANCF", "Exudyn without drag", "MoorDyn RK4", "paper's method"
CONTESTANTS = {
    OWN: (own_step.run, ""),
    UNIFORM: (own_step.run, ""),
    FMU: (own_step.run_fmu, ""),
    EXUDYN: (peer_exudyn.run, "exudyn"),
    BARE: (peer_exudyn.run, "exudyn"),
    MOORDYN: (peer_moordyn.run, "moordyn"),
    PAPER: (paper_method.run, ""),
}
"""How each runs, and the package of the optional group `bench` that it needs."""
KEYS = ("position_rms_m", "top_force_rms_N", "bending_rms_N_m")


@dataclass(frozen=True)
class Race:
    """A run of another contestant that ours must beat `factor` times, with an error of at most `error` [m] (None: of its own)."""

    against: Setting
    factor: float
    error: float | None = None


def _own(*pairs: tuple[int, float]) -> tuple[Setting, ...]:
    return tuple(Setting(OWN, n, h, "adapted") for n, h in pairs)


_OURS = (
    *_own((12, 0.4), (16, 0.4), (24, 0.4), (24, 0.2), (32, 0.2), (40, 0.4 / 3), (48, 0.1), (64, 0.1), (64, 0.05), (96, 0.05)),
    *(Setting(UNIFORM, n, h) for n, h in ((40, 0.2), (48, 0.4 / 3), (48, 0.1), (80, 0.05), (96, 0.05))),
    *(Setting(FMU, n, h, "adapted") for n, h in ((24, 0.2), (48, 0.1), (96, 0.05))),
)
_CRUDE = tuple(Setting(UNIFORM, n, h) for n, h in ((8, 2.5), (8, 1.5), (16, 1.2), (16, 0.8)))  # as much as the paper's method reaches
_COARSE, _FINE = Setting(EXUDYN, 48, 0.1), Setting(EXUDYN, 96, 0.05)
_LUMPED, _LUMPED_FINE = Setting(MOORDYN, 48, 0.00625), Setting(MOORDYN, 192, 0.00156, repeats=1)
_PAPER = tuple(Setting(PAPER, n, 1e-2, repeats=1) for n in (24, 48, 96))
_STUCK = Setting(PAPER, 24, 1e-3, repeats=1, span=48.0)  # no race: from 40 s on its step falls below a millisecond
_EXUDYN = (Setting(EXUDYN, 24, 0.2), Setting(EXUDYN, 48, 0.2), _COARSE, _FINE, Setting(BARE, 48, 0.1))
_SHEAR = f"pipe.section.shear_stiffness={PIPE.section.stiffness[1]!r}"
CASES = {
    "heave": LineCase(
        swing(2.0, 12.0), 300.0, (*_OURS, *_CRUDE, *_EXUDYN, _LUMPED, _LUMPED_FINE, *_PAPER, _STUCK),
        Setting(OWN, 192, 0.025, "adapted"), Setting(OWN, 96, 0.05, "adapted"), (_SHEAR,),
    ),
    "snap": LineCase(
        swing(6.0, 8.0), 60.0, (*_OURS, *_EXUDYN, _LUMPED, *_PAPER),
        Setting(OWN, 192, 0.0125, "adapted"), Setting(OWN, 96, 0.025, "adapted"),
        (_SHEAR, "top_motion.amplitude=[0.0,0.0,-6.0]", "top_motion.period=8.0", "top_motion.ramp=16.0"),
    ),
}  # fmt: skip
RACES = {
    "heave": (
        Race(_COARSE, 3.0, 1e-3), Race(_FINE, 3.0, 2e-4), Race(_LUMPED, 10.0), Race(_LUMPED_FINE, 50.0),
        *(Race(one, 100.0) for one in _PAPER),
    ),
}  # fmt: skip


def missing() -> list[str]:
    """Packages of the optional group `bench` that are not installed."""
    return sorted({package for _, package in CONTESTANTS.values() if package and importlib.util.find_spec(package) is None})


def settings(case: LineCase) -> list[Setting]:
    """The runs of a case that can be made here."""
    without = missing()
    return [setting for setting in case.settings if CONTESTANTS[setting.contestant][1] not in without]


def count(case: LineCase) -> int:
    """How many runs a sweep makes."""
    return 2 + sum(setting.repeats for setting in settings(case))


def _run(case: LineCase, setting: Setting) -> tuple[float, Histories]:
    parameters = replace(PIPE, nodes=setting.elements + 1, mesh="uniform" if setting.mesh == "uniform" else "adapted")
    return CONTESTANTS[setting.contestant][0](parameters, replace(case, duration=setting.span or case.duration), setting)


def sweep(case: LineCase, tick: Callable[[], object]) -> tuple[list[dict[str, Any]], tuple[float, float, float]]:
    """A row for every run, CPU times the medians of interleaved repeats; and the uncertainty of the reference.

    A run that fails has NaN for both. Raises RunError where the reference fails.
    """
    exact = _run(case, case.reference)[1]
    tick()
    uncertainty = _run(case, case.check)[1].distance(exact)
    tick()
    wanted = settings(case)
    spent: dict[Setting, list[float]] = {setting: [] for setting in wanted}
    errors: dict[Setting, tuple[float, float, float]] = {}
    for turn in range(max(setting.repeats for setting in wanted)):
        for setting in wanted:
            if turn < setting.repeats:
                try:
                    seconds, found = _run(case, setting)
                    errors[setting] = found.distance(exact.until(len(found.position)))
                except RunError:  # too coarse to come through the snap, which is a result
                    seconds, errors[setting] = math.nan, (math.nan, math.nan, math.nan)
                spent[setting].append(seconds)
                tick()
    rows: list[dict[str, Any]] = [
        {
            "contestant": s.contestant, "elements": s.elements, "step_s": s.step_s, "mesh": s.mesh, "repeats": s.repeats,
            "simulated_s": s.span or case.duration, "cpu_s": statistics.median(spent[s]), **dict(zip(KEYS, errors[s], strict=True)),
        }
        for s in wanted
    ]  # fmt: skip
    for row in rows:
        row["cpu_share"] = row["cpu_s"] / row["simulated_s"]
    return rows, uncertainty


def verdicts(name: str, rows: Sequence[dict[str, Any]]) -> list[tuple[str, float, float]]:
    """What is raced, how many times faster ours is, and how many times it must be at least; what did not run is left out."""
    found = []
    for race in RACES.get(name, ()):
        theirs = next((row for row in rows if (row["contestant"], row["elements"], row["step_s"]) == _key(race.against)), None)
        if theirs is None:
            continue
        error = theirs["position_rms_m"] if race.error is None else race.error
        able = [row for row in rows if row["contestant"] in (OWN, UNIFORM) and row["position_rms_m"] <= error]
        best = min(able, key=lambda row: row["cpu_share"], default=None)
        ours = f"ours at {error:.2g} m, {best['elements']} x {best['step_s']:.3g} s" if best else f"none of ours reaches {error:.2g} m"
        what = f"{race.against.contestant} {race.against.elements} x {race.against.step_s:g} ({theirs['position_rms_m']:.2g} m) over {ours}"
        found.append((what, theirs["cpu_share"] / best["cpu_share"] if best else 0.0, race.factor))
    return found


def _key(setting: Setting) -> tuple[str, int, float]:
    return setting.contestant, setting.elements, setting.step_s
