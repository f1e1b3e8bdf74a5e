"""The power bond between two FMUs: pairs of effort and flow ports whose product is power.

Signs. Ports connect without a gain: the effort port f carries the pull on what the mobility end moves, and F = -f acts
on the impedance end. Work done on the mobility end is H f.V, on the impedance end H F.V, so a bond on which both ends
hold the same f and V creates no energy.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fmu import Fmu, Names

Vector = NDArray[Any]
Matrix = NDArray[Any]

_INCREMENT = 1e3  # floors: flow increment of a difference quotient, far above the units' Newton noise
_RELATIVE_INCREMENT = 1e-3  # of the effort


@dataclass(frozen=True)
class Pair:
    """An effort port and its flow port; below `floor` a flow counts as rest."""

    effort: str
    flow: str
    floor: float
    size: int = 3


@dataclass(frozen=True)
class Bond:
    """All pairs of one connection; vectors of the bond are their ports one after the other."""

    pairs: tuple[Pair, ...]

    @property
    def efforts(self) -> tuple[str, ...]:
        """Names of the effort ports."""
        return tuple(pair.effort for pair in self.pairs)

    @property
    def flows(self) -> tuple[str, ...]:
        """Names of the flow ports."""
        return tuple(pair.flow for pair in self.pairs)

    @cached_property
    def size(self) -> int:
        """Number of scalar pairs."""
        return sum(pair.size for pair in self.pairs)

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *np.cumsum([pair.size for pair in self.pairs])[:-1].tolist()]

    @cached_property
    def _floors(self) -> Vector:
        return np.array([pair.floor for pair in self.pairs])

    def idle_power(self, effort: Vector) -> float:
        """Sum over the pairs of |effort| x floor [W]: the power that counts as nothing."""
        return float(np.sqrt(np.add.reduceat(effort * effort, self._starts)) @ self._floors)

    def flow_increments(self) -> Vector:
        """Increments of the flows for difference quotients, (size,)."""
        return np.repeat(_INCREMENT * self._floors, [pair.size for pair in self.pairs])

    def effort_increments(self, effort: Vector) -> Vector:
        """Increments of the efforts for difference quotients, (size,)."""
        norms = np.sqrt(np.add.reduceat(effort * effort, self._starts))
        norms[norms == 0.0] = 1.0 / _RELATIVE_INCREMENT
        return np.repeat(_RELATIVE_INCREMENT * norms, [pair.size for pair in self.pairs])


def hang_off() -> Bond:
    """The bond of pipe and vessel: force with velocity, moment with angular velocity."""
    return Bond((Pair("force", "velocity", 1e-6), Pair("moment", "angular_velocity", 1e-8)))


class FmuEnd:
    """One end of a bond: an FMU that steps while it holds one set of ports and answers with the conjugate one.

    `derivative` names the FMU's port with d(result)/d(held), row by row, times `sign`; None, or a port that the FMU
    does not have, leaves the master to difference quotients. Between `begin` and `commit` or `cancel` every `solve`
    starts from the same saved state.
    """

    def __init__(self, fmu: Fmu, held: Names, result: Names, derivative: str | None = None, sign: float = 1.0) -> None:
        self.fmu, self._held, self._result, self._sign = fmu, held, result, sign
        self._derivative = derivative if derivative in fmu.ports else None
        self._saved: ctypes.c_void_p | None = None
        self._moved = False
        self.solves = 0

    def begin(self) -> None:
        """Save the state that `solve` starts from."""
        self._saved, self._moved = self.fmu.snapshot(), False

    def solve(self, time: float, step: float, held: Vector) -> Vector:
        """Step from `time` with `held` on the ports; the conjugate ports. Raises StepRejected, FmuFailed."""
        if self._saved is not None and self._moved:
            self.fmu.restore(self._saved)
        self._moved = True
        self.solves += 1
        self.fmu.set(self._held, held)
        self.fmu.step(time, step, final=self._saved is None)
        return self.fmu.get(self._result)

    def result(self) -> Vector:
        """The conjugate ports as they are."""
        return self.fmu.get(self._result)

    def derivative(self) -> Matrix | None:
        """d(result)/d(held) at the last solve, (n, n), if the FMU offers it."""
        if self._derivative is None:
            return None
        values = self.fmu.get(self._derivative)
        return self._sign * values.reshape(-1, int(np.sqrt(values.size)))

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


def impedance_end(fmu: Fmu, bond: Bond, derivative: str | None = "impedance") -> FmuEnd:
    """The end that takes flows and returns efforts; its `derivative` port is dF/dV with F = -effort."""
    return FmuEnd(fmu, bond.flows, bond.efforts, derivative, -1.0)


def mobility_end(fmu: Fmu, bond: Bond, derivative: str | None = "mobility") -> FmuEnd:
    """The end that takes efforts and returns flows; its `derivative` port is d(flow)/d(effort)."""
    return FmuEnd(fmu, bond.efforts, bond.flows, derivative, 1.0)
