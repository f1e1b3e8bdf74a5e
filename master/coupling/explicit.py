"""The explicit schemes that most masters use, to compare with."""

from __future__ import annotations

from ..fmu.errors import StepRejected
from .bond import Bond
from .scheme import Check, Counters, CouplingFailed, End, Step, accept, within


class Explicit:
    """One solve of each end a step, no rollback: serial (Gauss-Seidel) or parallel (Jacobi) exchange.

    Conditionally stable at best, and only with ends that exchange values at the end of the step; for comparison. The
    residual is that of the mean values: what each end was given times what it answered, over the step.
    """

    def __init__(self, impedance: End, mobility: End, bond: Bond, macro_step: float, serial: bool, check: Check = accept) -> None:
        self.impedance, self.mobility, self.bond = impedance, mobility, bond
        self.macro_step, self.serial, self.check = macro_step, serial, check
        self.words = f"{'serial' if serial else 'parallel'} exchange of values at the end of the step, not iterated"
        self.counters = Counters()
        self._flow, self._effort = mobility.result(), impedance.result()

    def advance(self, time: float, limit: float) -> Step:
        """One step from `time`, at most to `time` + `limit`. Raises CouplingFailed, FmuFailed."""
        step = within(limit, self.macro_step)
        try:
            flow = self.mobility.solve(time, step, self._effort)
            held = flow if self.serial else self._flow
            effort = self.impedance.solve(time, step, held)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), str(rejection)) from None
        mean_flow, mean_effort = self.mobility.mean(), self.impedance.mean()
        done = Step(time, step, mean_flow, mean_effort, step * float(self._effort @ mean_flow - mean_effort @ held), 1)
        self._flow, self._effort = flow, effort
        self.counters.steps += 1
        self.counters.rounds.append(1)
        if not self.check(done):
            raise CouplingFailed(time, step, done.residual, "the check sent the step back")
        return done
