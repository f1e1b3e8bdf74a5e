"""What a step without rollback knows of the mobility end: its answer, foreseen, and made good once it is known.

The end answers V = r + Y f. Its slope Y is that of the last step (port or directional derivatives, else measured over the steps so far), in
proportion to the step's length as a mass has it. What its state contributes, r, is extrapolated in the way that lately foresaw best: as
r = v + h a, with the velocity v at the end of the last step, v_new = 2 V - v, and the acceleration a without f; as r = v + h (a + d v),
with a decay d <= 0 fitted to each component; or as such. The impedance end solves its step against that law, by iteration as in
`master.coupling` or, where it yields, at once. The mobility end then steps with the f found.

Both hold the same f, whatever the ratio of their masses. What the mobility end moves beyond what was foreseen, the impedance end makes up
for in the next step: a kinematic gap is left, small where the motion is smooth, and a residual H f . (V - V foreseen). The first steps are
short, since nothing is known yet.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from .bond import Bond, Matrix, Vector
from .extrapolation import Extrapolation
from .fmu import StepRejected
from .step import CouplingFailed, End

MEMORY = 0.5  # per step: how fast a foresight's past failure is forgotten

FIT = 0.9  # per step: weight of the past in the measured slope
REGULAR = 1e-6  # of the data: below it a direction counts as not seen


class Foreseen:
    """A mobility end by its law; `take` solves the end itself, for good. Nothing need be foreseen of an end that can roll back."""

    rollback, yields = True, False

    def __init__(self, end: End, bond: Bond) -> None:
        self.end = end
        self.varies = end.varies
        flow, self._scale = end.result(), bond.flow_increments()
        self._velocity, self._time, self._step = flow, 0.0, 0.0
        self._squares = self._products = np.zeros((bond.size, bond.size))  # of changes of the effort, of those with accelerations
        self._seen: deque[tuple[Vector, Vector]] = deque(maxlen=3)  # accelerations and efforts of the last steps
        self._slope = np.zeros((bond.size, bond.size))  # Y over the length of its step
        self._plain = Extrapolation(flow, flow, self._size)
        self._inert, self._damped = (Extrapolation(np.zeros(bond.size), np.zeros(bond.size), self._size) for _ in range(2))
        self._errors = np.zeros(3)
        self._past: deque[tuple[Vector, Vector]] = deque(maxlen=3)  # accelerations without f, and velocities before
        self._decay, self._numerator, self._denominator = (np.zeros(bond.size) for _ in range(3))
        self._behind = np.zeros(bond.size)  # what the impedance end has still to make up for
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
        """The flow that the end is expected to answer."""
        self._time, self._step = time, step
        if self.end.rollback:
            flow, slope = self.end.solve(time, step, held), self.end.derivative()
            self._slope = self._slope if slope is None else slope / step
            return flow + self._behind / step
        best = int(np.argmin(self._errors))
        return self._candidates(time, step)[best] + step * self._slope @ held + self._behind / step

    def take(self, time: float, step: float, held: Vector, foretold: Vector) -> Vector:
        """The flow that the end does answer, where the other end was told `foretold`.

        Raises CouplingFailed where it discards, for there is no way back, and FmuFailed.
        """
        self._taken = True
        foreseen = self._candidates(time, step)
        try:
            flow = self.end.solve(time, step, held)
        except StepRejected as rejection:
            raise CouplingFailed(time, step, float("nan"), f"{rejection}; it cannot roll back") from None
        slope = self.end.derivative()
        velocity = 2.0 * flow - self._velocity
        self._slope = self._measured((flow - self._velocity) / step, held) if slope is None else slope / step
        free = flow - step * self._slope @ held
        missed = [self._size(free - guess) for guess in foreseen]
        self._errors = np.maximum(missed, MEMORY * self._errors)
        middle = time + step / 2
        self._plain.add(middle, free, free)
        acceleration = (free - self._velocity) / step
        self._fit_decay(acceleration)
        smooth = acceleration - self._decay * self._velocity
        self._inert.add(middle, acceleration, acceleration)
        self._damped.add(middle, smooth, smooth)
        self._velocity, self._behind = velocity, self._behind + step * (flow - foretold)
        return flow

    def derivative(self) -> Matrix:
        """d(flow)/d(effort) of `solve`."""
        return self._step * self._slope

    def meet(self, time: float, step: float, free: Vector, mobility: Matrix) -> None:
        """See `master.step.End`: it takes no flow."""

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

    def _measured(self, acceleration: Vector, effort: Vector) -> Matrix:
        """The slope that best explains the changes of acceleration by those of the effort, symmetric and not negative.

        Directions in which the effort has not changed have the slope of those in which it has. In units of the flows that count.
        """
        answer, cause = acceleration / self._scale, effort * self._scale
        self._seen.append((answer, cause))
        if len(self._seen) < 3:
            return self._slope
        change, of = (self._seen[0][k] - 2.0 * self._seen[1][k] + self._seen[2][k] for k in (0, 1))
        self._squares = FIT * self._squares + np.outer(of, of)
        self._products = FIT * self._products + np.outer(change, of)
        size = float(np.trace(self._squares))
        if size == 0.0:
            return self._slope
        mean = max(float(np.trace(self._products)) / size, 0.0) * np.eye(len(of))
        ridge = REGULAR * size * np.eye(len(of))
        slope = mean + np.linalg.solve(self._squares + ridge, (self._products - mean @ self._squares).T).T
        values, vectors = np.linalg.eigh((slope + slope.T) / 2)
        return np.outer(self._scale, self._scale) * (vectors * np.maximum(values, 0.0) @ vectors.T)

    def _size(self, error: Vector) -> Any:
        """Of an error of the flow, or of every row of several."""
        return np.abs(error / self._scale).max(axis=-1)

    def _candidates(self, time: float, step: float) -> tuple[Vector, ...]:
        middle, v = time + step / 2, self._velocity
        return (
            v + step * self._inert.at(middle)[0],
            v + step * (self._damped.at(middle)[0] + self._decay * v),
            self._plain.at(middle)[0],
        )

    def _fit_decay(self, acceleration: Vector) -> None:
        """The rate at which a component's own velocity slows it down, by second differences, which a smooth load leaves alone."""
        self._past.append((acceleration, self._velocity))
        if len(self._past) == 3:
            a, v = (self._past[0][k] - 2.0 * self._past[1][k] + self._past[2][k] for k in (0, 1))
            self._numerator, self._denominator = FIT * self._numerator + a * v, FIT * self._denominator + v * v
            seen = self._denominator > 0.0
            self._decay[seen] = np.minimum(self._numerator[seen] / self._denominator[seen], 0.0)
