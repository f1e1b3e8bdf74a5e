"""One step of a power bond by energy-consistent iteration (EC-IJ).

An impedance end answers the mean flow V over a step with the mean effort f, a mobility end answers f with V; each holds
what it is given. The step is accepted when the bond makes no energy. With F = -f, Z = dF/dV >= 0 and Y = dV/df >= 0:

    V, f     extrapolated from the last accepted steps                                       # no solve
    V_free = mobility(f) - Y f
    repeat:  f_v = solve(1 + Z Y, f + Z (V - V_free));  V_new = mobility(f_v);  f_new = impedance(V_new)
             residual = H (f_v - f_new).V_new                                                # energy made by the bond
             V, f, V_free = V_new, f_new, V_new - Y f_v

Z and Y follow the ends' ports, where there are such, which makes the iteration Newton's; else Z follows Broyden's update,
and difference quotients after four rounds. Both ends hold the same V_new, so there is no kinematic gap.

An impedance end that can yield (see `master.coupling.end.FmuEnd.meet`) takes V_free and Y at the extrapolated f and finds V and f at once,
within its own Newton iteration. If the mobility end answers this f with the same V to round-off, as it does where it is nearly linear over
the error of the extrapolation, the step is done, with one solve of the impedance end. Else V_free and Y are taken anew at this f, and
one more solve, with the V that the mobility end answered, confirms it. Without yielding, two solves make a step where f is linear in V,
one where nothing happens, more where the extrapolation fails.

A step that is not accepted, or that an FMU discards, is tried again with half the length, down to a smallest one; the length grows again
after a few easy steps. A step that leaves an FMU in error, or is answered with NaN, is halved once only, and none is where an FMU takes but
one length. A tolerance below the round-off of the ends' answers is met to that round-off: a residual that no longer falls is accepted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fmu.errors import StepFailed, StepRejected
from .bond import Bond, Matrix, Vector
from .predictor import Extrapolation
from .scheme import SLIVER, Check, Counters, CouplingFailed, End, Step, accept

DIFFERENCES_ROUNDS = (4, 8)  # rounds after which Z is taken by differences: without ports, and with (one may be wrong)
LAST_ROUND = 12
FALLING = 0.3  # of the defect of the round before: more is no progress
ROUND_OFF = 1e-10  # of the product of the magnitudes: without progress below this the ends' own round-off is reached
SAME, STILL = 1e-12, 1e-8  # of a flow, and of one that counts as rest: what moves no pose by more than its own round-off
FORESEEN = 0.1  # of the tolerance: a defect this small needs no better effort before it is confirmed
EASY = 3  # rounds of an easy step
LEAST = 1e-3  # of the mean mobility
PATIENCE = 4  # easy steps in a row after which a halved step grows
SMALLEST_STEP = 2.0**-12  # of the macro step


class _Point(NamedTuple):
    """Where a round starts: flow, effort, and the flow `free` of the mobility end's law, free + Y f."""

    flow: Vector
    effort: Vector
    free: Vector
    answered: bool  # whether the effort is the impedance end's answer to the flow


class EnergyConsistent:
    """EC-IJ. `tolerance` is relative to the energy exchanged in the step; `macro_step` the longest step [s].

    `check` sees a step before it is committed (the ends' outputs are those of its end) and may send it back.
    """

    def __init__(
        self, impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float = 1e-9, check: Check = accept
    ) -> None:
        self.impedance, self.mobility, self.bond = impedance, mobility, bond
        self.macro_step, self.tolerance, self.check = macro_step, tolerance, check
        self.wanted = macro_step
        self._smallest = SMALLEST_STEP * macro_step if impedance.varies and mobility.varies else macro_step
        self.counters = Counters()
        self._guess = Extrapolation(mobility.result(), impedance.result(), bond.idle_power)
        self._one = np.eye(bond.size)
        self._Z = self._Y = np.empty((0, 0))
        self._inverse: Matrix | None = None  # Y^-1, once it is asked for
        self._length = 0.0  # the step they belong to; 0: none
        self._easy = 0  # steps of the wanted length that took few rounds, in a row
        self._exchanged = 0.0  # so far [J]

    @property
    def words(self) -> str:
        """What is done, for the report."""
        return "energy-consistent, iterated with rollback"

    def advance(self, time: float, limit: float) -> Step:
        """One accepted step from `time`, at most to `time` + `limit`.

        Raises CouplingFailed if even the smallest step is rejected, FmuFailed if an FMU breaks down.
        """
        step = min(self.wanted, limit)
        if limit - step < SLIVER * step:
            step = limit
        failures = 0
        while True:
            residual, reason = float("nan"), "the check sent the step back"
            self.impedance.begin()
            self.mobility.begin()
            try:
                trial, agreed = self._attempt(time, step)
                if agreed and self.check(trial):
                    return self._commit(trial)
                if not agreed:
                    residual, reason = trial.residual, f"bond residual {trial.residual:.3g} J after {trial.rounds} rounds"
            except StepRejected as rejection:
                failures += isinstance(rejection, StepFailed)
                reason = str(rejection)
            self.impedance.cancel()
            self.mobility.cancel()
            self._length = 0.0
            self.counters.rejected_steps += 1
            if failures > 1 or step / 2 < self._smallest:
                reason += "; an FMU takes no other step" if self._smallest == self.macro_step else ""
                raise CouplingFailed(time, step, residual, reason)
            step = self.wanted = step / 2
            self._easy = 0

    def _attempt(self, time: float, step: float) -> tuple[Step, bool]:
        """Try one step. Return it as far as it came, and whether the ends agree on it."""
        fresh = abs(step - self._length) > SLIVER * step  # slopes of another step length are of no use
        start = self._predict(time, step, fresh)
        if (met := self.impedance.meet(time, step, start.free, self._Y)) is not None:
            return self._confirm(time, step, *met, fresh)
        if fresh:
            start = start._replace(effort=self.impedance.solve(time, step, start.flow), answered=True)
            self._find_impedance(time, step, start.flow, start.effort)
        return self._iterate(time, step, start)

    def _predict(self, time: float, step: float, fresh: bool) -> _Point:
        """Extrapolate flow and effort, and solve the mobility end for that effort: V_free, and Y where it is `fresh` or asked for."""
        flow, effort = self._guess.at(time + step / 2)
        answer = self.mobility.solve(time, step, effort)
        slope = self.mobility.derivative() if fresh or self.impedance.yields else None
        if slope is None and fresh:
            slope = self._differences(self.mobility, time, step, effort, answer)
        self._set_mobility(slope)
        return _Point(flow, effort, answer - self._Y @ effort, False)

    def _confirm(self, time: float, step: float, flow: Vector, effort: Vector, fresh: bool) -> tuple[Step, bool]:
        """Solve the mobility end for the effort at which the impedance end met `flow`. Where it answers otherwise, iterate from there."""
        answer = self.mobility.solve(time, step, effort)
        trial = Step(time, step, answer, effort, step * float(effort @ (answer - flow)), 1)
        if not fresh and self._alike(flow, trial):
            return trial, True
        agreed = not fresh and self._agree(flow, trial)
        if not agreed:
            self._set_mobility(self.mobility.derivative())
            self._find_impedance(time, step, flow, effort)
        start = _Point(flow, effort, answer - self._Y @ effort, True)
        return self._iterate(time, step, start, answer if agreed else None)

    def _iterate(self, time: float, step: float, start: _Point, answer: Vector | None = None) -> tuple[Step, bool]:
        """Iterate from `start` until the bond makes no energy. `answer` is the mobility end's to that effort, if only to be confirmed."""
        before = np.inf
        for rounds in range(1, LAST_ROUND + 1):
            Z, Y, held = self._Z, self._Y, start.effort
            if answer is None or rounds > 1:
                held = np.linalg.solve(self._one + Z @ Y, held + Z @ (start.flow - start.free))
                answer = self.mobility.solve(time, step, held)
            new_effort = self.impedance.solve(time, step, answer)
            gap = held - new_effort
            trial = Step(time, step, answer, new_effort, step * float(gap @ answer), rounds)
            defect = abs(trial.residual) + step * abs(float(gap @ Y @ gap))
            if not np.isfinite(defect):
                break
            stalled = defect > FALLING * before and defect <= ROUND_OFF * step * float(np.abs(new_effort) @ np.abs(answer))
            if stalled or defect <= self.tolerance * self._energy_scale(trial):
                return trial, True
            before = defect
            self._mend(start, trial)
            start = _Point(answer, new_effort, answer - self._Y @ held, True)
        return trial, False

    def _mend(self, start: _Point, trial: Step) -> None:
        """Renew Z and Y after the round that went from `start` to `trial`."""
        slope = self.impedance.derivative() if trial.rounds <= DIFFERENCES_ROUNDS[True] else None
        if trial.rounds == DIFFERENCES_ROUNDS[slope is not None]:
            self._Z = -self._differences(self.impedance, trial.time, trial.step, trial.flow, trial.effort)
        elif slope is not None:
            self._Z = -slope
        elif start.answered:
            self._broyden(trial.flow - start.flow, start.effort - trial.effort)
        self._set_mobility(self.mobility.derivative())

    def _alike(self, met: Vector, trial: Step) -> bool:
        """Whether the mobility end answers with the flow that the impedance end met, to round-off: then the step is done."""
        apart, size = self.bond.sizes(np.array([met - trial.flow, trial.flow]))
        agreed = bool((apart <= SAME * size + STILL * self.bond.floors).all())
        return agreed and abs(trial.residual) <= self.tolerance * self._energy_scale(trial)

    def _agree(self, met: Vector, trial: Step) -> bool:
        """Whether it answers so nearly with that flow that the defect to be expected is small: then the effort needs no mending."""
        gap = self._Z @ (met - trial.flow)
        defect = abs(float(gap @ trial.flow)) + abs(float(gap @ self._Y @ gap))
        return defect <= FORESEEN * self.tolerance * abs(float(trial.effort @ trial.flow))

    def _commit(self, trial: Step) -> Step:
        self.impedance.commit()
        self.mobility.commit()
        self._guess.add(trial.time + trial.step / 2, trial.flow, trial.effort)
        self._exchanged += trial.step * abs(float(trial.effort @ trial.flow))
        self.counters.steps += 1
        self.counters.rounds.append(trial.rounds)
        if trial.step >= self.wanted:
            self._easy = self._easy + 1 if trial.rounds <= EASY else 0
            if self._easy >= PATIENCE:
                self.wanted, self._easy = min(2 * self.wanted, self.macro_step), 0
        return trial

    def _energy_scale(self, trial: Step) -> float:
        """The energy [J] that the residual is compared with: that exchanged, the moved end's kinetic energy, or what counts as rest.

        The kinetic energy counts up to the mean exchange so far: a heavy end that crosses the pull at speed would
        otherwise let residuals pass that add up to more than the tolerance of the energy exchanged.
        """
        exchanged = trial.step * abs(float(trial.effort @ trial.flow))
        mean, kinetic = (self._exchanged + exchanged) / (self.counters.steps + 1), 0.0
        if mean > exchanged:
            kinetic = trial.step * abs(float(trial.flow @ self._inertia @ trial.flow)) / 4  # Y = H/2 x inverse inertia
        return max(exchanged, min(kinetic, mean), trial.step * self.bond.idle_power(trial.effort))

    def _differences(self, end: End, time: float, step: float, held: Vector, result: Vector) -> Matrix:
        """d(result)/d(held) of the step just solved, by forward differences from the saved state."""
        increments = self.bond.flow_increments() if end is self.impedance else self.bond.effort_increments(held)
        return np.column_stack([(end.solve(time, step, held + d) - result) / d.sum() for d in np.diag(increments)])

    def _find_impedance(self, time: float, step: float, flow: Vector, effort: Vector) -> None:
        """Set Z where the impedance end has answered `flow` with `effort`: what it tells, else by differences."""
        slope = self.impedance.derivative()
        self._Z = -(self._differences(self.impedance, time, step, flow, effort) if slope is None else slope)
        self._length = step

    def _set_mobility(self, Y: Matrix | None) -> None:
        """Set Y; None, of an end that tells none, leaves it."""
        if Y is not None:
            self._Y, self._inverse = Y, None

    @property
    def _inertia(self) -> Matrix:
        """Inverse of Y, to which LEAST of its mean is added: where an end hardly moves, a mobility that was measured is but round-off."""
        if self._inverse is None:
            units = self.bond.flow_increments() ** 2
            mean = float((np.diagonal(self._Y) / units).mean())
            self._inverse = np.linalg.inv(self._Y + np.diag(LEAST * mean * units)) if mean > 0.0 else np.zeros_like(self._Y)
        return self._inverse

    def _broyden(self, d_flow: Vector, d_force: Vector) -> None:
        """Change Z by the least, measured by the inertia, that explains the last two points."""
        weighted = self._inertia @ d_flow
        size = float(d_flow @ weighted)
        if size > 0.0:
            self._Z = self._Z + np.outer(d_force - self._Z @ d_flow, weighted) / size
