"""The command `hard-cases`: the pipe alone where simulations of lines fail, each case at three steps.

Every accepted step must keep the energy identity: the energy it makes, the change of the stored energies less the works of top and current
plus the dissipated works, is at most 1e-10 of the sum of the absolute works and energy changes plus 1e-14 of the absolute energies. A step
that does not converge is halved, as the master does; a run whose step would fall below the 2^-8th of its own stops there.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TextIO

import numpy as np
from tqdm import tqdm

from pipe_fmu import Pipe, PipeParameters, Seabed, Section
from pipe_fmu.environment import Current, Environment
from pipe_fmu.maths.so3 import matrix
from pipe_fmu.step.integrator import StepResult
from pipe_fmu.step.state import WORKS, PipeState

HALVINGS = 8
_OF_EXCHANGED, _OF_STORED = 1e-10, 1e-14
_CURRENT = WORKS.index("current")
_AS_IT_HANGS = (0.0, 0.0, 0.0, 0.0)

Motion = Callable[[float], tuple[np.ndarray, float]]  # time [s] -> displacement of the top [m], e, and turn about its own first axis [rad]


def swing(amplitude: float, period: float, axis: tuple[float, float, float] = (0.0, 0.0, 1.0), until: float = math.inf) -> Motion:
    """Sine along `axis`, raised over two periods; at rest from `until` [s] on."""

    def motion(t: float) -> tuple[np.ndarray, float]:
        t = min(t, until)
        raised = 0.5 * (1.0 - math.cos(math.pi * min(t / (2.0 * period), 1.0)))
        return -amplitude * raised * math.sin(2.0 * math.pi * t / period) * np.array(axis), 0.0

    return motion


def shift(way: tuple[float, float, float], duration: float, turn: float = 0.0) -> Motion:
    """Moved by `way` [m] and turned by `turn` [rad] along a raised cosine of `duration` [s]."""

    def motion(t: float) -> tuple[np.ndarray, float]:
        share = 0.5 * (1.0 - math.cos(math.pi * min(t / duration, 1.0)))
        return share * np.array(way), share * turn

    return motion


@dataclass(frozen=True)
class Case:
    """A pipe that starts at rest, and the motion of its top."""

    name: str
    pipe: PipeParameters
    motion: Motion
    duration: float = 40.0  # s
    steps_s: tuple[float, ...] = (0.05, 0.2, 1.0)


@dataclass
class Outcome:
    """What became of a case at one step.

    halved: steps that did not converge and were halved; corrections: of the accepted steps, given up searches included;
    closure_over_allowed: energy made in a step over what the identity allows, the largest of all accepted steps;
    energy_made_over_exchanged: of the whole run, its drift.
    """

    case: str
    step_s: float
    outcome: str = "converged"
    steps: int = 0
    halved: int = 0
    mean_corrections: float = 0.0
    most_corrections: int = 0
    closure_over_allowed: float = 0.0
    energy_made_over_exchanged: float = 0.0
    cpu_s: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether every accepted step keeps the identity."""
        return self.closure_over_allowed <= 1.0


def run(case: Case) -> Iterator[Outcome]:
    """The outcomes of a case, one for every step."""
    pipe = Pipe(case.pipe)
    found, state = pipe.start(0.0)
    if not found.converged:
        yield from (Outcome(case.name, h, f"statics failed, residual {found.residual:.1e}") for h in case.steps_s)
        return
    for h in case.steps_s:
        pipe.step(state, np.zeros(3), np.zeros(3), h)  # compiles what is not yet compiled, outside the clock
        yield _march(case, pipe, state, h)


def _march(case: Case, pipe: Pipe, state: PipeState, h: float) -> Outcome:
    out, corrections, made, exchanged = Outcome(case.name, h), 0, 0.0, 0.0
    axis = np.array(matrix(tuple(state.quaternion[-1])))[:, 0]
    start = time.process_time()
    todo = [(k * h, (k + 1) * h) for k in reversed(range(round(case.duration / h)))]
    while todo:
        a, b = todo.pop()
        result = _step(case, pipe, state, axis, a, b)
        if result.converged:
            energy, traffic, allowed = _balance(pipe, state, result.state)
            state, made, exchanged = result.state, made + energy, exchanged + traffic
            out.steps, corrections = out.steps + 1, corrections + result.iterations
            out.most_corrections = max(out.most_corrections, result.iterations)
            out.closure_over_allowed = float(np.maximum(out.closure_over_allowed, abs(energy) / allowed))  # not a number stays one
            continue
        if b - a < 1.5 * h / 2**HALVINGS:
            out.outcome = f"stopped at {a:.3f} s, residual {result.residual:.1e}"
            break
        out.halved += 1
        todo += [(0.5 * (a + b), b), (a, 0.5 * (a + b))]
    out.cpu_s = time.process_time() - start
    out.mean_corrections = corrections / max(out.steps, 1)
    out.energy_made_over_exchanged = abs(made) / exchanged if exchanged else 0.0
    return out


def _step(case: Case, pipe: Pipe, state: PipeState, axis: np.ndarray, a: float, b: float) -> StepResult:
    (here, turned), (there, turning) = case.motion(a), case.motion(b)
    return pipe.step(state._replace(time=a), (there - here) / (b - a), (turning - turned) / (b - a) * axis, b - a)


def _balance(pipe: Pipe, old: PipeState, new: PipeState) -> tuple[float, float, float]:
    """Energy made in a step, energy exchanged in it, and what the identity allows [J]."""
    stored = np.array(pipe.energies(new))
    change = stored - pipe.energies(old)
    top, works = new.top_work - old.top_work, new.works - old.works
    given = top + works[_CURRENT]
    lost = works.sum() - works[_CURRENT]
    made = change.sum() - given + lost
    exchanged = np.abs(change).sum() + abs(top) + np.abs(works).sum()
    return float(made), float(exchanged), float(_OF_EXCHANGED * exchanged + _OF_STORED * np.abs(stored).sum())


def cases() -> tuple[Case, ...]:
    """The table of the cases."""
    tube = Section(wall_thickness=0.025, drag_normal=1.0, drag_tangential=0.01 * math.pi, rotational_damping=(0.0, 0.0, 0.0))
    axial, _, _, bending, _ = tube.stiffness
    nearly_weightless = replace(tube, mass=1.02 * 1025.0 * tube.outer_area)
    no_drag = replace(tube, drag_normal=1e-9, drag_tangential=1e-9)
    heave, violent = swing(2.0, 12.0), swing(6.0, 8.0)
    at_800 = Environment(depth=810.0, current=Current(velocity=(0.0, 0.8, 0.0)))
    hanging = PipeParameters(section=tube, top="pinned", top_position=(800.0, 0.0, -800.0), top_quaternion=_AS_IT_HANGS, environment=at_800)
    laid = replace(hanging, top_position=(780.0, 0.0, -800.0), seabed=Seabed())
    vertical = replace(laid, top="clamped", top_position=(470.0, 0.0, -800.0), top_quaternion=_pitch(90.0))
    straight_up = replace(hanging, foot="pinned", top_position=(0.0, 0.0, -800.0), length=800.5)
    beyond = replace(vertical, top_position=(450.0, 0.0, -800.0), top_quaternion=_pitch(110.0))
    behind = replace(hanging, foot="pinned", top_position=(-300.0, 0.0, -800.0), length=900.0)
    reversing = Environment(depth=810.0, current=Current(velocity=(0.0, 0.8, 0.0), period=5.0))
    deep = Environment(depth=3000.0, current=Current(velocity=(0.0, 0.8, 0.0)))
    near = Environment(depth=100.0, current=Current(velocity=(0.0, 0.2, 0.0)))
    short = replace(hanging, section=nearly_weightless, length=200.0, top="clamped", top_position=(196.0, 0.0, -20.0), environment=near)
    uneven = (0.0, *(100.0 * k for k in range(1, 6)), 500.1, *(500.1 + 100.0 * k for k in range(1, 7)), 1200.0)
    lying = replace(laid, top_position=(1199.9999, 0.0, -0.01), environment=Environment(depth=100.0))
    return (
        Case("J-lay, top vertical", vertical, heave),
        Case("vertical line, pinned foot", straight_up, swing(1.0, 12.0)),
        Case("top beyond vertical, 110 degrees", beyond, heave),
        Case("top behind the foot", behind, heave),
        Case("ten turns of end twist", replace(hanging, top="clamped"), shift((0.0, 0.0, 0.0), 40.0, 20.0 * math.pi)),
        Case("snap, slack to taut", hanging, violent),
        Case("compression and looping", short, shift((-300.0, 0.0, 0.0), 40.0, 2.0 * math.pi)),
        Case("EI / 10 000", replace(hanging, section=replace(tube, bending_stiffness=1e-4 * bending)), heave),
        Case("EA x 100", replace(hanging, section=replace(tube, axial_stiffness=100.0 * axial)), heave),
        Case("3000 m of water", replace(hanging, length=3900.0, top_position=(2000.0, 0.0, -3000.0), environment=deep), heave),
        Case("current reversed every 5 s", replace(hanging, environment=reversing), heave),
        Case("top moved 50 m in a second", hanging, shift((-30.0, 40.0, 0.0), 1.0), 20.0),
        Case("top moved 100 m in a second", hanging, shift((-60.0, 80.0, 0.0), 1.0), 20.0),
        Case("0.1 m beside 100 m", replace(hanging, nodes=len(uneven), nodes_at=uneven), heave),
        Case("an hour without drag", replace(hanging, section=no_drag, nodes=12), swing(2.0, 12.0, until=36.0), 3600.0, (0.5, 1.0, 2.0)),
        Case("lying line lifted", lying, shift((-10.0, 0.0, -40.0), 40.0)),
        Case("foot pinned", replace(hanging, foot="pinned"), heave),
        Case("bed with friction, violent", replace(laid, seabed=Seabed(friction=0.5)), violent),
    )


def _pitch(degrees: float) -> tuple[float, float, float, float]:
    half = 0.5 * math.radians(degrees)
    return (math.cos(half), 0.0, math.sin(half), 0.0)


NAMES = tuple(case.name for case in cases())


def study(names: Sequence[str], folder: Path, stream: TextIO) -> tuple[str, bool]:
    """Run the cases (all if none is named) and write hard-cases.csv into `folder`; what to print, and whether the identity is kept.

    Progress goes to `stream` if it is a terminal.
    """
    wanted = [case for case in cases() if case.name in names or not names]
    total = sum(len(case.steps_s) for case in wanted)
    outcomes: list[Outcome] = []
    folder.mkdir(parents=True, exist_ok=True)
    with (
        (folder / "hard-cases.csv").open("w", newline="", encoding="utf-8") as file,
        tqdm(total=total, file=stream, disable=not stream.isatty(), leave=False, unit="run") as progress,
    ):
        writer = csv.DictWriter(file, [column.name for column in fields(Outcome)])
        writer.writeheader()
        for case in wanted:
            progress.set_description(case.name)
            for outcome in run(case):
                outcomes.append(outcome)
                writer.writerow(asdict(outcome))
                file.flush()
                progress.update()
    return _table(outcomes), all(outcome.holds for outcome in outcomes)


def _table(outcomes: Sequence[Outcome]) -> str:
    width = max(len(o.outcome) for o in outcomes)
    head = (
        f"{'case':32} {'step s':>6}  {'outcome':{width}} {'steps':>5} {'halved':>6} {'mean':>5} {'most':>4} "
        f"{'closure/allowed':>15} {'made/exchanged':>14} {'cpu s':>6}"
    )
    rows = [
        f"{o.case:32} {o.step_s:6g}  {o.outcome:{width}} {o.steps:5d} {o.halved:6d} {o.mean_corrections:5.1f} {o.most_corrections:4d} "
        f"{o.closure_over_allowed:15.3f} {o.energy_made_over_exchanged:14.1e} {o.cpu_s:6.1f}{'' if o.holds else '  NOT KEPT'}"
        for o in outcomes
    ]
    converged = sum(o.outcome == "converged" for o in outcomes)
    broken = sum(not o.holds for o in outcomes)
    kept = f"NOT kept in {broken}" if broken else "kept in every accepted step"
    return "\n".join([head, *rows, "", f"{converged} of {len(outcomes)} runs converged; the energy identity is {kept}"])
