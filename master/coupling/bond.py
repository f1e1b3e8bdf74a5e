"""The power bond between two FMUs: pairs of effort and flow ports whose product is power.

Signs. Ports connect without a gain: the effort port f carries the pull on what the mobility end moves, and F = -f acts
on the impedance end. Work done on the mobility end is H f.V, on the impedance end H F.V, so a bond on which both ends
hold the same f and V creates no energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
Matrix = NDArray[Any]

_INCREMENT = 1e3  # floors: flow increment of a difference quotient, far above the units' Newton noise
_RELATIVE_INCREMENT = 1e-3  # of the effort


@dataclass(frozen=True)
class Pair:
    """An effort port and its flow port; below `floor` a flow counts as rest.

    `effort` is an output of the impedance end, `flow` one of the mobility end; the inputs they feed have the same names, or
    `effort_input` and `flow_input`. `end_effort` and `end_flow` are outputs with the values at the end of a step, for the
    schemes that exchange those. `met_flow` is an output of the impedance end with the flow of its last step, for one that
    yields, see `master.coupling.end.FmuEnd.meet`. `reverse`: the effort port carries what acts on the impedance end itself.
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
