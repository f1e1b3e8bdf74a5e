"""What moves the FMUs of a pipe: coupled with the vessel, or alone, its top held or moved as prescribed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from master.coupling.choose import coupling
from master.coupling.end import end_value_ends, impedance_end, mobility_end
from master.coupling.energy_consistent import SMALLEST_STEP
from master.coupling.hang_off import hang_off
from master.coupling.ledger import Columns, Ledger
from master.coupling.scheme import Step
from master.fmu.errors import StepRejected
from master.fmu.instance import Fmu, Names
from master.results.recorder import Source
from master.run.drive import OnBond, Row, snapped
from master.run.warnings import Remarks
from master.scene.reading import Sections, simulated
from master.scene.sections import Load, mean_load

LOADS = {"e": ("environment_force", "environment_moment"), "b": ("environment_force_b", "environment_moment_b")}


@dataclass(frozen=True)
class Cost:
    """Macro steps accepted and rejected, and steps asked of each unit."""

    macro_steps: int = 0
    rejected_steps: int = 0
    pipe_solves: int = 0
    vessel_solves: int = 0


class Coupled(OnBond):
    """Pipe and vessel, joined at the hang-off point by an energy-consistent bond."""

    def __init__(self, pipe: Fmu, vessel: Fmu, sections: Sections) -> None:
        rules, bond = sections.coupling, hang_off()
        self.time = 0.0
        self.units = {"pipe": pipe, "vessel": vessel}
        self.remarks = Remarks.of_start(self.units)
        self._clamped = sections.pipe.get("top") != "pinned"
        if rules.scheme == "energy-consistent":
            self._pipe, self._vessel = impedance_end(pipe, bond, rollback=rules.rollback), mobility_end(vessel, bond)
        else:
            self._pipe, self._vessel = end_value_ends(pipe, vessel, bond)
        sources = [(pipe, columns(pipe, "top_work")), (vessel, columns(vessel, "bond_work"))]
        self.ledger = Ledger(sources, rules.energy_check, rules.on_violation)
        self._macro_step = simulated(sections).macro_step
        self._coupling = coupling(rules.scheme, self._pipe, self._vessel, bond, self._macro_step, rules.tolerance, self.ledger.check)

    @property
    def cost(self) -> Cost:
        """See `Drive`."""
        done = self._coupling.counters
        return Cost(done.steps, done.rejected_steps, self._pipe.solves, self._vessel.solves)

    def derived(self) -> Row:
        """See `Drive`."""
        return pose_gap(self.units["pipe"], self.units["vessel"], self._clamped) | top_tension(self.units["pipe"])


class Mover:
    """The prescribed motion as the other end of the bond: it passes work from outside on to the pipe. Reads like an FMU."""

    name = "mover"
    ports: Mapping[str, object] = dict.fromkeys(("supplied_work", "bond_work"))

    def __init__(self) -> None:
        self.supplied = 0.0

    def port(self, name: str) -> object:
        """Any port of `ports`."""
        return self.ports[name]

    def get(self, names: Names) -> np.ndarray:
        """The work supplied from outside, and as much with the other sign through the bond [J]."""
        sign = {"supplied_work": 1.0, "bond_work": -1.0}
        return np.array([sign[name] * self.supplied for name in ((names,) if isinstance(names, str) else names)])


class Prescribed:
    """The pipe alone, its top held, or moved: mean velocities over each step are the exact change of its position over its length."""

    def __init__(self, pipe: Fmu, sections: Sections) -> None:
        rules, motion = sections.coupling, sections.top_motion
        self.scheme = "the top is held" if motion is None else "the top is moved as prescribed"
        self.time = 0.0
        self.units: Mapping[str, Fmu] = {"pipe": pipe}
        self.remarks = Remarks.of_start(self.units)
        self._pipe, self._motion, self._mover = impedance_end(pipe, hang_off()), motion, Mover()
        mover = (self._mover, Columns(work=("supplied_work",), bond="bond_work"))
        self.ledger = Ledger([(pipe, columns(pipe, "top_work")), mover], rules.energy_check, rules.on_violation)
        self._macro_step = self._wanted = simulated(sections).macro_step
        self._steps = self._rejected = 0

    @property
    def cost(self) -> Cost:
        """See `Drive`."""
        return Cost(self._steps, self._rejected, self._pipe.solves)

    def advance(self, end: float) -> None:
        """See `Drive`."""
        step = min(self._wanted, end - self.time)
        while not self._attempt(step):
            self._rejected += 1
            step = self._wanted = step / 2
        self.time = snapped(self.time + step, self._macro_step, end)
        self.remarks.note(self.units, self.time)
        self._wanted = min(2.0 * self._wanted, self._macro_step)
        self._steps += 1

    def _attempt(self, step: float) -> bool:
        """Take one step, and go back unless the pipe and the ledger accept it. Raises StepRejected for the smallest step."""
        flow = np.zeros(6)
        if self._motion is not None:
            flow[:3] = self._motion.mean_velocity(self.time, step)
        before = self._mover.supplied
        self._pipe.begin()
        try:
            effort = self._pipe.solve(self.time, step, flow)
            self._mover.supplied = before - step * float(effort @ flow)
            accepted = self.ledger.check(Step(self.time, step, flow, effort, 0.0, 1))
        except StepRejected:
            if step / 2.0 < SMALLEST_STEP * self._macro_step:
                raise
            accepted = False
        if accepted:
            self._pipe.commit()
        else:
            self._pipe.cancel()
            self._mover.supplied = before
        return accepted

    def derived(self) -> Row:
        """See `Drive`."""
        return top_tension(self.units["pipe"])


class LoadedFmu(Fmu):
    """An FMU under the loads of a table, set as their mean over whatever step is asked for."""

    rows: Sequence[Load] = ()
    inputs = LOADS["e"]

    def step(self, time: float, step: float, final: bool = False) -> None:
        """See `Fmu.step`."""
        self.set(self.inputs, np.concatenate(mean_load(self.rows, time, step)))
        super().step(time, step, final)


@contextmanager
def open_drive(sections: Sections, fmus: Mapping[str, Path]) -> Iterator[Coupled | Prescribed]:
    """Load and initialise the FMU files of a prepared scene, `pipe` and, unless it is alone, `vessel`. Raises FmuFailed."""
    with ExitStack() as stack:

        def load(unit: str, kind: type[Fmu] = Fmu) -> Fmu:
            return stack.enter_context(kind(fmus[unit], unit))

        pipe = load("pipe")
        pipe.initialize()
        if sections.vessel is None:
            yield Prescribed(pipe, sections)
            return
        vessel = load("vessel", LoadedFmu if sections.tables else Fmu)
        if isinstance(vessel, LoadedFmu) and sections.tables:
            vessel.rows, vessel.inputs = sections.tables.environment, LOADS[sections.tables.frame]
        pull = {name: pipe.get(name) for name in hang_off().efforts}
        vessel.initialize(inputs=pull)
        yield Coupled(pipe, vessel, sections)


def columns(fmu: Fmu, bond: str) -> Columns:
    """The energy outputs of a unit by the endings of their names; `bond` is the work done on it through the bond."""

    def ending(suffix: str) -> tuple[str, ...]:
        return tuple(name for name in fmu.names("output") if name.endswith(suffix) and name != bond)

    return Columns(ending("_energy"), ending("_work"), ending("_dissipation"), bond)


def top_tension(pipe: Source) -> Row:
    """Tension n_1 at the top: the force on the pipe there along the normal t1; the port holds the reaction."""
    x, y, z, q0, q1, q2, q3 = pipe.get(("end_force", "top_quaternion")).tolist()
    t1 = (1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 + q0 * q3), 2.0 * (q1 * q3 - q0 * q2))
    return {("top_tension", "N"): -(x * t1[0] + y * t1[1] + z * t1[2])}


def pose_gap(pipe: Source, vessel: Source, clamped: bool = True) -> Row:
    """Distance [m] and, if `clamped`, angle [rad] between the two units' idea of the hang-off point's pose."""
    held = pipe.get(("top_position", "top_quaternion")).tolist()
    holding = vessel.get(("hang_off_position", "hang_off_quaternion")).tolist()
    (p0, p1, p2, p3), (q0, q1, q2, q3) = held[3:], holding[3:]
    vector = (  # of conj(p) q: the sine of half the angle
        p0 * q1 - q0 * p1 - p2 * q3 + p3 * q2,
        p0 * q2 - q0 * p2 - p3 * q1 + p1 * q3,
        p0 * q3 - q0 * p3 - p1 * q2 + p2 * q1,
    )
    angle = 2.0 * math.asin(min(1.0, math.hypot(*vector)))
    return {("pose_gap", "m"): math.dist(held[:3], holding[:3])} | ({("pose_gap_angle", "rad"): angle} if clamped else {})
