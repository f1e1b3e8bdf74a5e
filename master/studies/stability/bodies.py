"""The pipe against a rigid end body of 100 kg to 100 000 t, taut, slack and snapping, at steps of 0.01 s to 1 s.

The body takes the vessel's place at the clamped top of a 1200 m pipe. A constant force and moment hold the static pull; a force along
the pull and a moment shake it. Both have a part in proportion to the pull, which moves a light body against the pipe, and one
in proportion to the body's mass, which gives a heavy body a motion of some metres and a tenth of a radian at the period of the sea.
Taut: the pull, mean over a step, stays above 0.7 of that at rest; slack: it falls below 0.15 of it; snapping: it rises above
twice that as well.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.hang_off import hang_off
from master.coupling.ledger import Columns
from master.errors import RunError
from master.fmu.instance import Fmu
from master.studies.stability.coupled import Half, paired

MASSES = tuple(10.0**k for k in range(2, 9))  # kg
STEPS = (0.01, 0.05, 0.2, 1.0)  # s
DURATION = 60.0  # s
GYRATION = 3.0  # m: the inertia is mass x its square
TOLERANCE = 1e-9  # of the coupling
LOST = 1e6  # m: a body this far away has left
PIPE = {"nodes": 24, "top_position": [804.7189562, 0.0, -800.0], "top_quaternion": [0.0] * 4}
PIPE_COLUMNS = Columns(
    ("kinetic_energy", "elastic_energy", "gravity_energy"), ("current_work",), ("drag_dissipation", "rotational_dissipation"), "top_work"
)
BODY_COLUMNS = Columns(("kinetic_energy", "restoring_energy"), ("environment_work",), ("damping_dissipation",), "bond_work")


@dataclass(frozen=True)
class State:
    """How hard the body is shaken: shares of the pull, excursion [m], turn [rad], period [s]."""

    name: str
    share: float
    excursion: float
    turn: float
    period: float


STATES = (
    State("taut", 0.2, 1.0, 0.05, 12.0),
    State("slack", 0.9, 10.0, 0.1, 12.0),
    State("snapping", 1.5, 8.0, 0.1, 8.0),
)


@dataclass(frozen=True)
class Case:
    """One run."""

    scheme: str
    mass: float
    step: float
    state: State
    duration: float = DURATION
    tolerance: float = TOLERANCE
    rollback: bool = True

    @property
    def label(self) -> str:
        """The scheme, or that each unit is solved once."""
        return self.scheme if self.rollback else "without rollback"


@dataclass(frozen=True)
class Outcome:
    """What came of a run; figures are those up to its end."""

    state: str
    mass_kg: float
    step_s: float
    scheme: str
    finished: bool
    end_s: float
    residual: float  # energy made by the bond over the energy exchanged
    gap_m: float
    gap_rad: float
    solves: float  # median of the pipe's solves per accepted step
    most_solves: int
    steps: int
    rejected: int
    still_pull: float  # kN, at rest
    least_pull: float  # of the mean pulls over a step
    largest_pull: float
    cpu_s: float
    message: str = ""

    @property
    def named_rightly(self) -> bool:
        """Whether the pull is as the state says."""
        low, high = self.least_pull / self.still_pull, self.largest_pull / self.still_pull
        return {"taut": low > 0.7, "slack": low < 0.15, "snapping": low < 0.15 and high > 2.0}[self.state]

    @property
    def holds(self) -> bool:
        """Whether the limits are kept."""
        most = 2.0 if self.mass_kg >= 1e6 else 4.0 if self.step_s <= 0.2 else math.inf
        exact = self.residual <= 1e-6 and max(self.gap_m, self.gap_rad) <= 1e-9
        return self.finished and exact and self.solves <= most and self.named_rightly


@dataclass(frozen=True)
class Rest:
    """The pipe at rest: files, pose of the top, pull on the body [N, N m]."""

    pipe: Path
    body: Path
    place: tuple[float, ...]
    quaternion: tuple[float, ...]
    pull: tuple[float, ...]


def at_rest(pipe: Path, body: Path) -> Rest:
    """The equilibrium of the pipe FMU, asked of itself."""
    with Fmu(pipe, "pipe") as fmu:
        fmu.initialize()
        values = (fmu.get(name) for name in ("top_position", "top_quaternion"))
        place, quaternion = (tuple(float(x) for x in value) for value in values)
        return Rest(pipe, body, place, quaternion, tuple(float(x) for x in fmu.get(("force", "moment"))))


def cases(duration: float = DURATION) -> list[Case]:
    """All 84 x 4 runs, long ones first."""
    ways = (("energy-consistent", True), ("energy-consistent", False), ("serial", True), ("parallel", True))
    return [
        Case(scheme, mass, step, state, duration, rollback=rollback)
        for step in STEPS
        for scheme, rollback in ways
        for mass in MASSES
        for state in STATES
    ]


def body_parameters(case: Case, rest: Rest) -> dict[str, Any]:
    """Parameters of the body."""
    pull, state = np.array(rest.pull), case.state
    tension, rate = float(np.linalg.norm(pull[:3])), 2.0 * math.pi / state.period
    along, inertia = pull[:3] / tension, case.mass * GYRATION**2
    force = (state.share * tension + 0.5 * case.mass * rate**2 * state.excursion) * along
    moment = (state.share * 1e5 + 0.5 * inertia * rate**2 * state.turn) * np.array([0.6, 0.64, 0.48])
    return {
        "mass": case.mass,
        "inertia": inertia,
        "load": (-pull[:3]).tolist(),
        "holding_moment": (-pull[3:]).tolist(),
        "shaking_force": force.tolist(),
        "shaking_moment": moment.tolist(),
        "period": state.period,
        "start": list(rest.place),
        "start_quaternion": list(rest.quaternion),
    }


def run(case: Case, rest: Rest) -> Outcome:
    """One case to its end, or to where it fails."""
    pipe = Half(rest.pipe, {}, ("end_force", "end_moment"), PIPE_COLUMNS)
    ends = ("end_velocity", "end_angular_velocity")
    body = Half(rest.body, body_parameters(case, rest), ends, BODY_COLUMNS)
    begun, message, gaps, solves, pulls = time.process_time(), "", np.zeros(2), [0], [float(np.linalg.norm(rest.pull[:3]))]
    with paired(pipe, body, hang_off(), case.scheme, case.step, case.tolerance, rollback=case.rollback) as pair:
        try:
            for _ in pair.run(case.duration):
                solves.append(pair.coupling.impedance.solves)
                gap = _gap(pair.impedance, pair.mobility)
                gaps = np.maximum(gaps, gap)
                pulls.append(float(np.linalg.norm(pair.impedance.get("force"))))
                if not gap[0] < LOST:
                    message = "the body has left"
                    break
        except RunError as error:
            message = str(error)
        done, ledger = pair.coupling.counters, pair.ledger
        return Outcome(
            case.state.name, case.mass, case.step, case.label, not message, pair.time,
            ledger.interface_residual / max(ledger.exchanged, 1e-300), float(gaps[0]), float(gaps[1]),
            float(np.median(np.diff(solves))) if len(solves) > 1 else math.nan,
            int(np.diff(solves).max(initial=0)), done.steps, getattr(done, "rejected_steps", 0),
            pulls[0] / 1e3, min(pulls) / 1e3, max(pulls) / 1e3, time.process_time() - begun, message,
        )  # fmt: skip


def _gap(pipe: Fmu, body: Fmu) -> np.ndarray:
    """Distance [m] and angle [rad] between the two units' ideas of the top's pose."""
    held, own = pipe.get(("top_position", "top_quaternion")), body.get(("place", "quaternion"))
    p, q = held[3:], own[3:]
    sine = np.linalg.norm(p[0] * q[1:] - q[0] * p[1:] - np.cross(p[1:], q[1:]))
    return np.array([math.dist(held[:3], own[:3]), 2.0 * math.asin(min(1.0, float(sine)))])
