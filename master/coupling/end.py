"""The ends of a bond: FMUs that step while they hold one set of its ports and answer with the other."""

from __future__ import annotations

import ctypes
from math import isqrt

import numpy as np

from ..fmi.ports import finite
from ..fmu.errors import StepFailed, StepRejected
from ..fmu.instance import Fmu, Names
from .bond import Bond, Matrix, Vector

_SAME = 1e-9  # of an answer: a unit that is restored repeats a step to its own round-off


class FmuEnd:
    """One end of a bond, an FMU.

    `derivative` names the FMU's port with d(result)/d(held), row by row, times `sign`; without it the FMU's directional
    derivatives serve, where it provides them, else difference quotients. `mean` names the outputs whose product with what
    the other end holds is the power, by default the result; `signs` are factors on both. `yielding` names the input by which
    the FMU takes the other end's mobility, `met` its outputs with the flow that it then finds. Between `begin` and `commit` or
    `cancel` every `solve` starts from the same saved state; an end with `rollback` False saves none.
    """

    def __init__(
        self,
        fmu: Fmu,
        held: Names,
        result: Names,
        derivative: str | None = None,
        sign: float = 1.0,
        mean: Names | None = None,
        signs: Vector | float = 1.0,
        rollback: bool = True,
        yielding: str = "",
        met: tuple[str, ...] = (),
    ) -> None:
        self.fmu, self._held, self._result, self._sign = fmu, _several(held), _several(result), sign
        self._mean, self._signs = self._result if mean is None else mean, signs
        self._derivative = derivative if derivative in fmu.ports else None
        self.yields = yielding in fmu.ports and all(name in fmu.ports for name in met)
        self._yielding, self._met = (yielding, (*self._result, *met)) if self.yields else ("", ())
        self._stiff = np.zeros(fmu.ports[yielding].size if self.yields else 0)
        self.rollback, self.varies = rollback and fmu.can_rollback, fmu.can_vary_step
        self._saved: ctypes.c_void_p | None = None
        self._moved = False
        self.solves = 0

    def begin(self) -> None:
        """Save the state that `solve` starts from."""
        self._saved, self._moved = self.fmu.snapshot() if self.rollback else None, False

    def solve(self, time: float, step: float, held: Vector) -> Vector:
        """Step from `time` with `held` on the ports and return the conjugate ports. Raises StepRejected, FmuFailed."""
        if self._yielding:
            self._step(time, step, (*self._held, self._yielding), np.concatenate([held, self._stiff]))
        else:
            self._step(time, step, self._held, held)
        result = self.result()
        if not finite(result):
            raise self._broken(time, step)
        return result

    def meet(self, time: float, step: float, free: Vector, mobility: Matrix) -> tuple[Vector, Vector] | None:
        """Step with the flow V for which V = `free` + `mobility` @ answer; return V and the answer, or None if the FMU cannot find them.

        Raises as `solve`.
        """
        if not self._yielding:
            return None
        self._step(time, step, (*self._held, self._yielding), np.concatenate([free, mobility.ravel()]))
        values = self.fmu.get(self._met)
        if not finite(values):
            raise self._broken(time, step)
        return values[free.size :], self._signs * values[: free.size]

    def restores(self, time: float, step: float, held: Vector) -> bool:
        """Whether two steps with `held` from one saved state answer alike; true where the unit rejects them. It stands as before."""
        self.begin()
        try:
            first, second = (self.solve(time, step, held) for _ in range(2))
        except StepRejected:
            return True
        finally:
            self.cancel()
        return bool(np.abs(second - first).max() <= _SAME * np.abs(first).max())

    def _step(self, time: float, step: float, ports: tuple[str, ...], values: Vector) -> None:
        if self._saved is not None and self._moved:
            self.fmu.restore(self._saved)
        self._moved = True
        self.solves += 1
        self.fmu.set(ports, values)
        self.fmu.step(time, step, final=self._saved is None)

    def _broken(self, time: float, step: float) -> StepFailed:
        return StepFailed(f"{self.fmu.name}: step of {step:.6g} s at {time:.9g} s: answers with a number that is not finite")

    def result(self) -> Vector:
        """The conjugate ports as they are now."""
        return self._signs * self.fmu.get(self._result)

    def mean(self) -> Vector:
        """The conjugate ports as means over the last step."""
        return self._signs * self.fmu.get(self._mean)

    def derivative(self) -> Matrix | None:
        """d(result)/d(held) at the last solve, (n, n), if the FMU offers it."""
        if self._derivative is None:
            return np.reshape(self._signs, (-1, 1)) * self.fmu.derivatives(self._result, self._held) if self.fmu.has_derivatives else None
        values = self.fmu.get(self._derivative)
        return self._sign * values.reshape(-1, isqrt(values.size))

    def commit(self) -> None:
        """Keep the last solve."""
        if self._saved is not None:
            self.fmu.release(self._saved)
            self._saved = None

    def cancel(self) -> None:
        """Go back to the saved state."""
        if self._saved is not None:
            self.fmu.restore(self._saved)
            self.commit()


def _several(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else names


def impedance_end(
    fmu: Fmu, bond: Bond, derivative: str | None = "impedance", rollback: bool = True, yielding: str = "mobility"
) -> FmuEnd:
    """The end that takes flows and returns efforts; its `derivative` port is dF/dV with F = -effort."""
    yielding = yielding if bond.met_flows else ""
    return FmuEnd(
        fmu, bond.flow_inputs, bond.efforts, derivative, -1.0, signs=bond.signs, rollback=rollback, yielding=yielding, met=bond.met_flows
    )


def mobility_end(fmu: Fmu, bond: Bond, derivative: str | None = "mobility", rollback: bool = True) -> FmuEnd:
    """The end that takes efforts and returns flows; its `derivative` port is d(flow)/d(effort)."""
    return FmuEnd(fmu, bond.effort_inputs, bond.flows, derivative, 1.0, rollback=rollback)


def end_value_ends(impedance: Fmu, mobility: Fmu, bond: Bond) -> tuple[FmuEnd, FmuEnd]:
    """Both ends for a scheme that exchanges the values at the end of a step; their power is still that of the means."""
    return (
        FmuEnd(impedance, bond.flow_inputs, bond.end_efforts, mean=bond.efforts, signs=bond.signs),
        FmuEnd(mobility, bond.effort_inputs, bond.end_flows, mean=bond.flows),
    )
