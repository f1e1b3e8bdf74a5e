"""One step of a power bond: energy-consistent iteration (EC-IJ), and the two explicit schemes to compare it with.

An impedance end answers the mean flow V over a step with the mean effort f, a mobility end answers f with V; each holds
what it is given. The step is accepted when the bond makes no energy. With F = -f, Z = dF/dV >= 0 and Y = dV/df >= 0:

    V, f     extrapolated from the last accepted steps                                       # no solve
    V_free = mobility(f) - Y f
    repeat:  f_v = solve(1 + Z Y, f + Z (V - V_free));  V_new = mobility(f_v);  f_new = impedance(V_new)
             residual = H (f_v - f_new).V_new                                                # energy made by the bond
             V, f, V_free = V_new, f_new, V_new - Y f_v

Z and Y follow the ends' ports, where there are such, which makes the iteration Newton's; else Z follows Broyden's update,
and difference quotients after four rounds. Both ends hold the same V_new, so there is no kinematic gap. Where f is linear in V
the second round is exact; with the extrapolated pair in place of a first solve, that makes two solves of the impedance
end a step, or one where nothing happens. A rejected step is tried again with half the length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .bond import Bond, Matrix, Vector
from .extrapolation import Extrapolation
from .fmu import FmuError, StepRejected

DIFFERENCES_ROUNDS = (4, 8)  # rounds after which Z is taken by differences: without ports, and with (one may be wrong)
LAST_ROUND = 12
EASY = 3  # rounds after which the step may grow
SMALLEST_STEP = 2.0**-12  # of the macro step
SLIVER = 1e-9  # of a step: a remainder that is round-off of the time


class End(Protocol):
    """One end of the bond, see `master.bond.FmuEnd`."""

    solves: int

    def begin(self) -> None: ...
    def solve(self, time: float, step: float, held: Vector) -> Vector: ...
    def result(self) -> Vector: ...
    def derivative(self) -> Matrix | None: ...
    def commit(self) -> None: ...
    def cancel(self) -> None: ...


@dataclass(frozen=True)
class Step:
    """An accepted step: its start, length, mean flow and effort (of the impedance end), bond residual [J], rounds."""

    time: float
    step: float
    flow: Vector
    effort: Vector
    residual: float
    rounds: int


@dataclass
class Counters:
    """Work done so far."""

    steps: int = 0
    rejected_steps: int = 0
    rounds: list[int] = field(default_factory=list)


class CouplingFailed(FmuError):  # noqa: N818
    """No agreement between the ends down to the smallest step; time [s], step [s], residual [J]."""

    def __init__(self, time: float, step: float, residual: float, reason: str) -> None:
        super().__init__(f"coupling failed at {time:.9g} s with a step of {step:.3g} s: {reason}")
        self.time, self.step, self.residual = time, step, residual


Check = Callable[[Step], bool]


def _accept(step: Step) -> bool:
    return True


class EnergyConsistent:
    """EC-IJ. `tolerance` is relative to the energy exchanged in the step; `macro_step` the longest step [s].

    `check` sees a step before it is committed (the ends' outputs are those of its end) and may send it back.
    """

    def __init__(
        self, impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float = 1e-9, check: Check = _accept
    ) -> None:
        self.impedance, self.mobility, self.bond = impedance, mobility, bond
        self.macro_step, self.tolerance, self.check = macro_step, tolerance, check
        self.wanted = macro_step
        self.counters = Counters()
        self._guess = Extrapolation(mobility.result(), impedance.result(), bond.idle_power)
        self._Z = self._Y = self._inertia = np.empty((0, 0))  # the last is Y^-1
        self._length = 0.0  # the step they belong to; 0: none
        self._converged = False
        self._exchanged = 0.0  # so far [J]

    def advance(self, time: float, limit: float) -> Step:
        """One accepted step from `time`, at most to `time` + `limit`.

        Raises CouplingFailed if even the smallest step is rejected, FmuFailed if an FMU breaks down.
        """
        step = min(self.wanted, limit)
        if limit - step < SLIVER * step:
            step = limit
        while True:
            residual, reason = float("nan"), "the check sent the step back"
            self.impedance.begin()
            self.mobility.begin()
            try:
                trial = self._attempt(time, step)
                if self._converged:
                    if self.check(trial):
                        return self._commit(trial)
                else:
                    residual = trial.residual
                    reason = f"bond residual {residual:.3g} J after {trial.rounds} rounds"
            except StepRejected as rejection:
                reason = str(rejection)
            self.impedance.cancel()
            self.mobility.cancel()
            self._length = 0.0
            self.counters.rejected_steps += 1
            if step / 2 < SMALLEST_STEP * self.macro_step:
                raise CouplingFailed(time, step, residual, reason)
            step = self.wanted = step / 2

    def _attempt(self, time: float, step: float) -> Step:
        flow, effort = self._guess.at(time + step / 2)
        on_law = step != self._length
        if on_law:  # Z of another step length is of no use: solve for a first point and take it there
            effort = self.impedance.solve(time, step, flow)
            self._length = step
        free = self.mobility.solve(time, step, effort)
        if on_law:
            slope, mobility = self.impedance.derivative(), self.mobility.derivative()
            self._Z = -(self._differences(self.impedance, time, step, flow, effort) if slope is None else slope)
            self._set_mobility(self._differences(self.mobility, time, step, effort, free) if mobility is None else mobility)
        free = free - self._Y @ effort
        self._converged, believed = False, True
        for rounds in range(1, LAST_ROUND + 1):
            Z, Y = self._Z, self._Y
            held = np.linalg.solve(np.eye(self.bond.size) + Z @ Y, effort + Z @ (flow - free))
            new_flow = self.mobility.solve(time, step, held)
            new_effort = self.impedance.solve(time, step, new_flow)
            gap = held - new_effort
            trial = Step(time, step, new_flow, new_effort, step * float(gap @ new_flow), rounds)
            defect = abs(trial.residual) + step * abs(float(gap @ Y @ gap))
            self._converged = defect <= self.tolerance * self._energy_scale(trial)
            if self._converged or not np.isfinite(defect):
                break
            slope = self.impedance.derivative() if believed else None
            if rounds == DIFFERENCES_ROUNDS[slope is not None]:
                self._Z = -self._differences(self.impedance, time, step, new_flow, new_effort)
                believed = False
            elif slope is not None:
                self._Z = -slope
            elif on_law:
                self._broyden(new_flow - flow, effort - new_effort)
            if (mobility := self.mobility.derivative()) is not None:
                self._set_mobility(mobility)
            flow, effort, free, on_law = new_flow, new_effort, new_flow - self._Y @ held, True
        return trial

    def _commit(self, trial: Step) -> Step:
        self.impedance.commit()
        self.mobility.commit()
        self._guess.add(trial.time + trial.step / 2, trial.flow, trial.effort)
        self._exchanged += trial.step * abs(float(trial.effort @ trial.flow))
        self.counters.steps += 1
        self.counters.rounds.append(trial.rounds)
        if trial.rounds <= EASY and trial.step >= self.wanted:
            self.wanted = min(2 * self.wanted, self.macro_step)
        return trial

    def _energy_scale(self, trial: Step) -> float:
        """What the residual is measured by [J]: energy exchanged, kinetic energy of the moved end, or that of rest.

        The kinetic energy counts up to the mean exchange so far: a heavy end that crosses the pull at speed would
        otherwise let residuals pass that add up to more than the tolerance of the energy exchanged.
        """
        exchanged = trial.step * abs(float(trial.effort @ trial.flow))
        kinetic = trial.step * abs(float(trial.flow @ self._inertia @ trial.flow)) / 4  # Y = H/2 x inverse inertia
        mean = (self._exchanged + exchanged) / (self.counters.steps + 1)
        return max(exchanged, min(kinetic, mean), trial.step * self.bond.idle_power(trial.effort))

    def _differences(self, end: End, time: float, step: float, held: Vector, result: Vector) -> Matrix:
        """d(result)/d(held) of the step just solved, by forward differences from the saved state."""
        increments = self.bond.flow_increments() if end is self.impedance else self.bond.effort_increments(held)
        columns = [(end.solve(time, step, held + d) - result) / d.sum() for d in np.diag(increments)]
        return np.column_stack(columns)

    def _set_mobility(self, Y: Matrix) -> None:
        self._Y = Y
        try:
            self._inertia = np.linalg.inv(Y)
        except np.linalg.LinAlgError:  # an end that cannot move in some direction has no inertia there
            self._inertia = np.linalg.pinv(Y)

    def _broyden(self, d_flow: Vector, d_force: Vector) -> None:
        """Least change of Z, measured by the inertia, that explains the last two points."""
        weighted = self._inertia @ d_flow
        size = float(d_flow @ weighted)
        if size > 0.0:
            self._Z = self._Z + np.outer(d_force - self._Z @ d_flow, weighted) / size


class Explicit:
    """One solve of each end a step, no rollback: serial (Gauss-Seidel) or parallel (Jacobi) exchange.

    Conditionally stable at best, and only with ends that exchange values at the end of the step; for comparison.
    """

    def __init__(self, impedance: End, mobility: End, bond: Bond, macro_step: float, serial: bool, check: Check = _accept) -> None:
        self.impedance, self.mobility, self.bond = impedance, mobility, bond
        self.macro_step, self.serial, self.check = macro_step, serial, check
        self.counters = Counters()
        self._flow, self._effort = mobility.result(), impedance.result()

    def advance(self, time: float, limit: float) -> Step:
        """One step from `time`, at most to `time` + `limit`. Raises CouplingFailed, FmuFailed."""
        step = limit if limit < (1 + SLIVER) * self.macro_step else self.macro_step
        try:
            flow = self.mobility.solve(time, step, self._effort)
            held = flow if self.serial else self._flow
            effort = self.impedance.solve(time, step, held)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), str(rejection)) from None
        done = Step(time, step, flow, effort, step * float(self._effort @ flow - effort @ held), 1)
        self._flow, self._effort = flow, effort
        self.counters.steps += 1
        self.counters.rounds.append(1)
        if not self.check(done):
            raise CouplingFailed(time, step, done.residual, "the check sent the step back")
        return done


SCHEMES = ("energy-consistent", "serial", "parallel")


def coupling(
    scheme: str, impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float = 1e-9, check: Check = _accept
) -> EnergyConsistent | Explicit:
    """The coupling named `scheme`. Raises ValueError for a name that is not in SCHEMES."""
    if scheme not in SCHEMES:
        raise ValueError(f"scheme = {scheme!r}: must be one of {', '.join(SCHEMES)}")
    if scheme == "energy-consistent":
        return EnergyConsistent(impedance, mobility, bond, macro_step, tolerance, check)
    return Explicit(impedance, mobility, bond, macro_step, scheme == "serial", check)
