"""Energy-consistent iteration against a mobility end that cannot roll back.

It is solved once, with the effort found against its law (predicted_end.py). The impedance end is then solved again for the flow that this
answered, changed by what little keeps the bond from making energy.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fmu.errors import StepRejected
from .bond import Bond, Vector
from .energy_consistent import PATIENCE, EnergyConsistent
from .predicted_end import PredictedEnd
from .scheme import Check, CouplingFailed, End, Step, accept

FIRST_STEP = 2.0**-10  # of the macro step: nothing is known yet
CLOSING = 4  # solves of the impedance end, at most, that close the energy of a step


class OneSided(EnergyConsistent):
    """EC-IJ with a `PredictedEnd` mobility end; an impedance end that yields need not roll back either."""

    def __init__(
        self, impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float = 1e-9, check: Check = accept
    ) -> None:
        self._foreseen = PredictedEnd(mobility, bond)
        super().__init__(impedance, self._foreseen, bond, macro_step, tolerance, check)
        if self._smallest < macro_step:
            self.wanted, self._easy = FIRST_STEP * macro_step, -PATIENCE  # all short steps add up to whole macro steps

    @property
    def words(self) -> str:
        """What is done, and the largest kinematic gap that it left so far."""
        how, left = "iterated on one side", "a gap"
        if not self.impedance.rollback:
            how, left = "not iterated", "a residual and a gap"
        pairs = zip(self.bond.pairs, self._foreseen.largest_gaps, strict=True)
        gaps = ", ".join(f"{pair.flow} x s {gap:.2g}" for pair, gap in pairs)
        return (
            f"energy-consistent, {how}: without rollback a unit is solved once a step, with its answer foreseen; {left} is left "
            f"(largest: {gaps}) and made up for in the next step"
        )

    def _attempt(self, time: float, step: float) -> tuple[Step, bool]:
        trial, agreed = super()._attempt(time, step) if self.impedance.rollback else (self._met(time, step), True)
        if not agreed:
            return trial, False
        held, flow, wanted = self._foreseen.take(time, step, trial.effort)
        if self.impedance.rollback and self._outweighed():
            trial = self._followed(trial, held, flow, wanted)
        else:
            trial = replace(trial, residual=step * float(held @ flow - trial.effort @ trial.flow))
        self._foreseen.owe(step * (flow - trial.flow), step * (trial.effort - held))
        return trial, True

    def _outweighed(self) -> bool:
        """Whether the mobility end yields less than the impedance end, Y Z < 1: an error of the foreseen flow is then small to it."""
        slope = self.impedance.derivative()
        if slope is not None:
            self._Z = -slope
        return bool(np.abs(np.linalg.eigvals(self._Y @ self._Z)).max() < 1.0)

    def _followed(self, trial: Step, held: Vector, flow: Vector, wanted: Vector) -> Step:
        """Solve the impedance end after a mobility end that has answered `held` with `flow`, so that the bond makes no energy.

        Its flow is `wanted` plus what little closes the energy, along d(f.V)/dV: the least in units of the flows that count.
        """
        step, start, Z = trial.step, wanted, self._Z
        try:
            effort = self.impedance.solve(trial.time, step, start)
        except StepRejected:
            start, effort = trial.flow, self.impedance.solve(trial.time, step, trial.flow)
        rate = effort - Z.T @ start
        along, told = self.bond.flow_increments() ** 2 * rate, start
        made, share = float(held @ flow - effort @ start), 0.0
        change = made / size if (size := float(rate @ along)) > 0.0 else 0.0
        for _ in range(CLOSING):
            done = Step(trial.time, step, told, effort, step * made, trial.rounds)
            if change == 0.0 or abs(done.residual) <= self.tolerance * self._energy_scale(done):
                break
            share += change
            told, before = start + share * along, made
            effort = self.impedance.solve(trial.time, step, told)
            made = float(held @ flow - effort @ told)
            change = change * made / (before - made) if before != made else 0.0
        return Step(trial.time, step, told, effort, step * made, trial.rounds)

    def _met(self, time: float, step: float) -> Step:
        """Solve the impedance end once, on the law of the other."""
        effort = self._guess.at(time + step / 2)[1]
        flow = self._foreseen.solve(time, step, effort)
        Y = self._foreseen.derivative()
        try:
            met = self.impedance.meet(time, step, flow - Y @ effort, Y)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), f"{rejection}; it cannot roll back") from None
        assert met is not None
        return Step(time, step, *met, 0.0, 1)
