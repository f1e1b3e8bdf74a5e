"""The power bond between two FMUs: pairs of effort and flow ports whose product is power.

Signs. Ports connect without a gain: the effort port f carries the pull on what the mobility end moves, and F = -f acts
on the impedance end. Work done on the mobility end is H f.V, on the impedance end H F.V, so a bond on which both ends
hold the same f and V creates no energy.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fmi.ports import finite
from ..fmu.instance import Fmu, Names, StepFailed, StepRejected

Vector = NDArray[Any]
Matrix = NDArray[Any]

_INCREMENT = 1e3  # floors: flow increment of a difference quotient, far above the units' Newton noise
_RELATIVE_INCREMENT = 1e-3  # of the effort
_SAME = 1e-9  # of an answer: a unit that is restored repeats a step to its own round-off


@dataclass(frozen=True)
class Pair:
    """An effort port and its flow port; below `floor` a flow counts as rest.

    `effort` is an output of the impedance end, `flow` one of the mobility end; the inputs they feed have the same names, or
    `effort_input` and `flow_input`. `end_effort` and `end_flow` are outputs with the values at the end of a step, for the
    schemes that exchange those. `met_flow` is an output of the impedance end with the flow of its last step, for one that
    yields, see `FmuEnd.meet`. `reverse`: the effort port carries what acts on the impedance end itself.
    """

    effort: str
    flow: str
    floor: float
    size: int = 3
    effort_input: str = ""
    flow_input: str = ""
    end_effort: str = ""
    end_flow: str = ""
    met_flow: str = ""
    reverse: bool = False


@dataclass(frozen=True)
class Bond:
    """All pairs of one connection; vectors of the bond are their ports one after the other."""

    pairs: tuple[Pair, ...]

    @property
    def efforts(self) -> tuple[str, ...]:
        """Names of the effort outputs, means over the step."""
        return tuple(pair.effort for pair in self.pairs)

    @property
    def flows(self) -> tuple[str, ...]:
        """Names of the flow outputs, means over the step."""
        return tuple(pair.flow for pair in self.pairs)

    @property
    def effort_inputs(self) -> tuple[str, ...]:
        """Names of the mobility end's inputs."""
        return tuple(pair.effort_input or pair.effort for pair in self.pairs)

    @property
    def flow_inputs(self) -> tuple[str, ...]:
        """Names of the impedance end's inputs."""
        return tuple(pair.flow_input or pair.flow for pair in self.pairs)

    @property
    def end_efforts(self) -> tuple[str, ...]:
        """Names of the effort outputs at the end of a step; the means where there are none."""
        return tuple(pair.end_effort or pair.effort for pair in self.pairs)

    @property
    def end_flows(self) -> tuple[str, ...]:
        """Names of the flow outputs at the end of a step; the means where there are none."""
        return tuple(pair.end_flow or pair.flow for pair in self.pairs)

    @property
    def met_flows(self) -> tuple[str, ...]:
        """Names of the impedance end's outputs with the flows of its last step; empty if one is not named."""
        names = tuple(pair.met_flow for pair in self.pairs)
        return names if all(names) else ()

    @cached_property
    def signs(self) -> Vector:
        """Factors from the effort outputs to the pull on the mobility end, (size,)."""
        return np.repeat([-1.0 if pair.reverse else 1.0 for pair in self.pairs], [pair.size for pair in self.pairs])

    @cached_property
    def size(self) -> int:
        """Number of scalar pairs."""
        return sum(pair.size for pair in self.pairs)

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *np.cumsum([pair.size for pair in self.pairs])[:-1].tolist()]

    @cached_property
    def floors(self) -> Vector:
        """Flows that count as rest, one a pair."""
        return np.array([pair.floor for pair in self.pairs])

    def sizes(self, vector: Vector) -> Vector:
        """Norm of every pair's part of a vector (size,), or of every row of one (k, size)."""
        return np.sqrt(np.add.reduceat(vector * vector, self._starts, axis=-1))

    def idle_power(self, effort: Vector) -> Any:
        """Sum over the pairs of |effort| x floor [W]: the power that counts as nothing; of every row (size,) of `effort`."""
        return self.sizes(effort) @ self.floors

    def flow_increments(self) -> Vector:
        """Increments of the flows for difference quotients, (size,)."""
        return np.repeat(_INCREMENT * self.floors, [pair.size for pair in self.pairs])

    def effort_increments(self, effort: Vector) -> Vector:
        """Increments of the efforts for difference quotients, (size,)."""
        norms = self.sizes(effort)
        norms[norms == 0.0] = 1.0 / _RELATIVE_INCREMENT
        return np.repeat(_RELATIVE_INCREMENT * norms, [pair.size for pair in self.pairs])


class FmuEnd:
    """One end of a bond: an FMU that steps while it holds one set of ports and answers with the conjugate one.

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
        """Step from `time` with `held` on the ports; the conjugate ports. Raises StepRejected, FmuFailed."""
        if self._yielding:
            self._step(time, step, (*self._held, self._yielding), np.concatenate([held, self._stiff]))
        else:
            self._step(time, step, self._held, held)
        result = self.result()
        if not finite(result):
            raise self._broken(time, step)
        return result

    def meet(self, time: float, step: float, free: Vector, mobility: Matrix) -> tuple[Vector, Vector] | None:
        """Step with a flow V that meets V = free + mobility x answer; V and answer, which belong together. None if the FMU cannot.

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
        """Whether two steps with `held` from one saved state answer alike, where the unit takes such steps; it stands as before."""
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
        """The conjugate ports as they are."""
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
