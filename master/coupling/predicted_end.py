"""What a step without rollback knows of the mobility end: its answer, foreseen, and what both ends make up for once it is known.

The end answers V = r + Y f. Where it tells the slope Y (port or directional derivatives), what its state contributes, r, is extrapolated in
the way that lately foresaw best: as r = v + h a, with the velocity v at the end of the last step, v_new = 2 V - v, and the acceleration a
without f; as r = v + h (a + d v), with a decay d <= 0 fitted to each component; or as such. Where it does not, r and Y are found from
the steps so far, see `mobility_law`. The impedance end solves its step against that law, by iteration as in `energy_consistent` or, where
it yields, at once. The mobility end then steps with the f found.

What it moves beyond what the impedance end was made to follow, a kinematic gap, that end makes up for in the next step; what the impedance
end then pulls beyond what the mobility end held, an impulse, is added to what that holds in the next step. Both are small where the motion
is smooth. The first steps are short, since nothing is known yet.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from ..fmu.errors import StepRejected
from .bond import Bond, Matrix, Vector
from .mobility_law import MeasuredLaw
from .predictor import Extrapolation
from .scheme import CouplingFailed, End

MEMORY = 0.5  # per step: how fast a foresight's past failure is forgotten

FIT = 0.9  # per step: weight of the past in the fitted decay


class PredictedEnd:
    """A mobility end that is asked for its foreseen answer, and solved once by `take`. An end that can roll back answers itself."""

    rollback, yields = True, False

    def __init__(self, end: End, bond: Bond) -> None:
        self.end, self.varies = end, end.varies
        self._time = self._step = 0.0
        self._told, self._measured = TellingLaw(end.result(), bond), MeasuredLaw(end.result(), bond.flow_increments())
        self._tells = True  # until it does not
        self._slope = np.zeros((bond.size, bond.size))  # Y of the last step solved
        self._gap = self._impulse = np.zeros(bond.size)  # to be made up for
        self._sizes, self.largest_gaps = bond.sizes, np.zeros(len(bond.pairs))
        self._taken = False

    @property
    def solves(self) -> int:
        """Solves of the end itself."""
        return self.end.solves

    def begin(self) -> None:
        """A step begins."""
        self._taken = False
        self.end.begin()

    def solve(self, time: float, step: float, held: Vector) -> Vector:
        """The flow that the end is expected to answer, with the gap closed."""
        self._time, self._step = time, step
        if self.end.rollback:
            flow, slope = self.end.solve(time, step, held), self.end.derivative()
            self._slope = self._slope if slope is None else slope
            return flow + self._gap / step
        law = self._told if self._tells else self._measured
        free, self._slope = law.at(time + step / 2, step)
        return free + self._slope @ (held + self._impulse / step) + self._gap / step

    def take(self, time: float, step: float, effort: Vector) -> tuple[Vector, Vector, Vector]:
        """Solve the end itself with `effort` and the impulse owed. Return what it held, its answer, and the flow that would close the gap.

        Raises CouplingFailed where the end discards the step, for there is no way back, and FmuFailed.
        """
        self._taken = True
        held = effort + self._impulse / step
        try:
            flow = self.end.solve(time, step, held)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), f"{rejection}; it cannot roll back") from None
        slope = self.end.derivative()
        self._tells = slope is not None
        if slope is None:
            self._measured.add(time + step / 2, step, flow, held)
        else:
            self._told.add(time + step / 2, step, flow, held, slope)
        return held, flow, flow + self._gap / step

    def owe(self, gap: Vector, impulse: Vector) -> None:
        """Leave a displacement and an impulse of this step to be made up for."""
        self._gap, self._impulse = self._gap + gap, self._impulse + impulse
        self.largest_gaps = np.maximum(self.largest_gaps, self._sizes(self._gap))

    def derivative(self) -> Matrix:
        """d(flow)/d(effort) of `solve`."""
        return self._slope

    def meet(self, time: float, step: float, free: Vector, mobility: Matrix) -> None:
        """See `master.coupling.scheme.End`: it takes no flow."""

    def result(self) -> Vector:
        """The flow as it is."""
        return self.end.result()

    def mean(self) -> Vector:
        """The flow as the mean over the last step."""
        return self.end.mean()

    def commit(self) -> None:
        """Keep the step."""
        self.end.commit()

    def cancel(self) -> None:
        """Go back. Raises CouplingFailed once the end itself is solved."""
        if self._taken:
            raise CouplingFailed(self._time, self._step, float("nan"), "the check sent the step back, and an FMU cannot roll back")
        self.end.cancel()


class TellingLaw:
    """The law of an end that tells its slope, which is in proportion to the step's length as a mass has it."""

    def __init__(self, flow: Vector, bond: Bond) -> None:
        self._scale, self._velocity = bond.flow_increments(), flow
        self._slope = np.zeros((bond.size, bond.size))  # Y over the length of its step
        self._plain = Extrapolation(flow, flow, self._size)
        self._inert, self._damped = (Extrapolation(np.zeros(bond.size), np.zeros(bond.size), self._size) for _ in range(2))
        self._errors = np.zeros(3)
        self._past: deque[tuple[Vector, Vector]] = deque(maxlen=3)  # accelerations without f, and velocities before
        self._decay, self._numerator, self._denominator = (np.zeros(bond.size) for _ in range(3))

    def at(self, middle: float, step: float) -> tuple[Vector, Matrix]:
        """r and Y of a step with this middle and length."""
        return self._candidates(middle, step)[int(np.argmin(self._errors))], step * self._slope

    def add(self, middle: float, step: float, flow: Vector, effort: Vector, slope: Matrix) -> None:
        """Take in a step and judge the ways by it."""
        free = flow - slope @ effort
        missed = [self._size(free - guess) for guess in self._candidates(middle, step)]
        self._errors = np.maximum(missed, MEMORY * self._errors)
        acceleration = (free - self._velocity) / step
        self._fit_decay(acceleration)
        smooth = acceleration - self._decay * self._velocity
        for law, value in ((self._plain, free), (self._inert, acceleration), (self._damped, smooth)):
            law.add(middle, value, value)
        self._velocity, self._slope = 2.0 * flow - self._velocity, slope / step

    def _size(self, error: Vector) -> Any:
        """The largest component of an error of the flow, in units of `_scale`; of every row of several."""
        return np.abs(error / self._scale).max(axis=-1)

    def _candidates(self, middle: float, step: float) -> tuple[Vector, ...]:
        v = self._velocity
        return (
            v + step * self._inert.at(middle)[0],
            v + step * (self._damped.at(middle)[0] + self._decay * v),
            self._plain.at(middle)[0],
        )

    def _fit_decay(self, acceleration: Vector) -> None:
        """Fit the rate [1/s] at which each component's own velocity slows it down to second differences, in which smooth loads cancel."""
        self._past.append((acceleration, self._velocity))
        if len(self._past) == 3:
            a, v = (self._past[0][k] - 2.0 * self._past[1][k] + self._past[2][k] for k in (0, 1))
            self._numerator, self._denominator = FIT * self._numerator + a * v, FIT * self._denominator + v * v
            seen = self._denominator > 0.0
            self._decay[seen] = np.minimum(self._numerator[seen] / self._denominator[seen], 0.0)
