"""The linearly implicit step for FMUs without rollback: each end is solved once, with the other's answer foreseen.

With the means V, f of a step, each end answers f = s - Z V and V = r + Y f. The slopes Z, Y >= 0 are those of the last step
(ports or directional derivatives); s and r are what the ends' states contribute, s = f + Z V after a step. For a spring, a
damper and a mass side by side, and a constant load, under the midpoint rule

    s_n - s_(n-1) = -a Z V_(n-1) + b Z (v_n - v_(n-1)),     v_n = 2 V_(n-1) - v_(n-1),     0 <= a <= 2, 0 <= b <= 1,

and likewise r with the identity for Z. The shares a and b are fitted for every component to the
steps so far. The bond is then solved for f_v = (1 + Z Y)^-1 (s - Z r), the mobility end steps with f_v, the impedance end
with the V that it answers. Nothing is iterated, so a residual H (f_v - f) . V is left: the guard of this step.
"""

from __future__ import annotations

import numpy as np

from ..fmu.errors import StepRejected
from .bond import Bond, Matrix, Vector
from .scheme import Check, Counters, CouplingFailed, End, Step, accept, within

MEMORY = 0.9  # per step: weight of the past in the fit of the shares
SMALLEST = 1e-12  # of the data: regularisation of the fit
LARGEST = (2.0, 1.0)  # shares of a passive end


class History:
    """Foresees what an end's state contributes to its answer, from the mean flows and contributions of past steps."""

    def __init__(self, contribution: Vector, velocity: Vector) -> None:
        self._last, self._velocity = contribution, velocity
        size = contribution.size
        self._normal, self._right = np.zeros((size, 2, 2)), np.zeros((size, 2))
        self._shares, self._basis = np.zeros((size, 2)), np.zeros((size, 2))

    def foreseen(self) -> Vector:
        """The contribution to the coming step, (n,)."""
        return self._last + np.sum(self._basis * self._shares, axis=1)

    def add(self, contribution: Vector, flow: Vector, weight: Matrix) -> None:
        """Take in a step's contribution and mean flow; `weight` (n, n) turns flows into contributions."""
        self._fit(contribution - self._last)
        velocity = 2 * flow - self._velocity
        self._basis = np.column_stack([-weight @ flow, weight @ (velocity - self._velocity)])
        self._last, self._velocity = contribution, velocity

    def _fit(self, change: Vector) -> None:
        basis = self._basis
        self._normal = MEMORY * self._normal + basis[:, :, None] * basis[:, None, :]
        self._right = MEMORY * self._right + basis * change[:, None]
        size = np.trace(self._normal, axis1=1, axis2=2)
        seen = size > 0.0
        ridge = SMALLEST * size[seen]
        system = self._normal[seen] + ridge[:, None, None] * np.eye(2)
        right = self._right[seen] + ridge[:, None] * self._shares[seen]
        self._shares[seen] = np.clip(np.linalg.solve(system, right[:, :, None])[:, :, 0], 0.0, LARGEST)


class LinearlyImplicit:
    """One solve of each end a step, no rollback. The slopes must not be underestimated; an end that offers none counts as rigid
    to what it is given (slope zero), which is stable only where that end answers weakly.
    """

    words = "energy-consistent, not iterated: without rollback each unit is solved once a step and a residual is left"

    def __init__(self, impedance: End, mobility: End, bond: Bond, macro_step: float, check: Check = accept) -> None:
        self.impedance, self.mobility, self.bond = impedance, mobility, bond
        self.macro_step, self.check = macro_step, check
        self.counters = Counters()
        flow, effort = mobility.result(), impedance.result()
        self._reaction, self._drift = History(effort, flow), History(flow, flow)
        self._Z = self._Y = np.zeros((bond.size, bond.size))

    def advance(self, time: float, limit: float) -> Step:
        """One step from `time`, at most to `time` + `limit`. Raises CouplingFailed, FmuFailed."""
        step, Z, Y = within(limit, self.macro_step), self._Z, self._Y
        foreseen = self._reaction.foreseen() - Z @ self._drift.foreseen()
        held = np.linalg.solve(np.eye(self.bond.size) + Z @ Y, foreseen)
        try:
            flow = self.mobility.solve(time, step, held)
            effort = self.impedance.solve(time, step, flow)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), str(rejection)) from None
        slope, mobility = self.impedance.derivative(), self.mobility.derivative()
        self._Z = Z if slope is None else -slope
        self._Y = Y if mobility is None else mobility
        self._reaction.add(effort + self._Z @ flow, flow, self._Z)
        self._drift.add(flow - self._Y @ held, flow, np.eye(self.bond.size))
        done = Step(time, step, flow, effort, step * float((held - effort) @ flow), 1)
        self.counters.steps += 1
        self.counters.rounds.append(1)
        if not self.check(done):
            raise CouplingFailed(time, step, done.residual, "the check sent the step back, and an FMU cannot roll back")
        return done
