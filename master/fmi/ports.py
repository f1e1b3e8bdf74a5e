"""Value references of a unit: inputs first, then outputs, then parameters, scalar by scalar."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .description import Variable, scalar_names
from .schema import Parameter

KINDS = ("Real", "Integer", "Boolean", "String")  # of FMI variables; ports are real
PortTable = Mapping[str, tuple[int, str, str]]  # name -> (size, unit, description)


class Run(NamedTuple):
    """Consecutive value references that belong to one port (or one parameter)."""

    causality: str
    name: str
    part: slice


class Ports:
    """The variables of one unit with one set of parameters."""

    def __init__(self, inputs: PortTable, outputs: PortTable, parameters: Mapping[str, Parameter]) -> None:
        self.inputs, self.outputs, self.parameters = dict(inputs), dict(outputs), dict(parameters)
        taken = inputs.keys() | outputs.keys()
        if twice := (inputs.keys() & outputs.keys()) | {name for name in parameters if name.partition("[")[0] in taken}:
            raise ValueError(f"{', '.join(sorted(twice))}: name of more than one port or parameter")
        self._places = [("input", name, i) for name, port in inputs.items() for i in range(port[0])]
        self.n_inputs = len(self._places)
        self._places += [("output", name, i) for name, port in outputs.items() for i in range(port[0])]
        self._places += [("parameter", name, 0) for name in parameters]
        self.input_slices: dict[str, slice] = {}
        first = 0
        for name, port in inputs.items():
            self.input_slices[name] = slice(first, first + port[0])
            first += port[0]

    def place(self, reference: int, kind: str = "Real") -> tuple[str, str, int]:
        """(causality, name, index in the port) of a value reference. Raises ValueError if there is none of that kind."""
        if not 0 <= reference < len(self._places):
            raise ValueError(f"value reference = {reference}: must be below {len(self._places)}")
        causality, name, _ = place = self._places[reference]
        own = self.parameters[name].kind if causality == "parameter" else "Real"
        if kind != own:
            raise ValueError(f"{name}: asked for as {kind}, is {own}")
        return place

    def runs(self, references: Sequence[int], kind: str = "Real") -> Iterator[Run]:
        """`references` of that kind in order, cut into runs that one port can answer at once. Raises ValueError as `place`."""
        i = 0
        while i < len(references):
            causality, name, first = self.place(references[i], kind)
            length, rest = 1, references[i:]
            while length < len(rest) and self.place(rest[length], kind) == (causality, name, first + length):
                length += 1
            yield Run(causality, name, slice(first, first + length))
            i += length

    def held(self, inputs: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """A copy of all inputs by name, which the unit may keep."""
        values = inputs.copy()
        return {name: values[part] for name, part in self.input_slices.items()}

    def not_finite(self, inputs: NDArray[np.float64]) -> str | None:
        """What to say of the first input that is not finite, if there is one."""
        if np.isfinite(inputs).all():
            return None
        bad = next(i for i, value in enumerate(inputs) if not math.isfinite(value))
        _, name, i = self.place(bad)
        return f"{name}[{i + 1}] = {inputs[bad]}: must be finite"

    def variables(self) -> list[Variable]:
        """Scalar variables for the model description, in the order of their value references."""
        groups = [("input", self.inputs, 0.0), ("output", self.outputs, None)]
        table = [
            Variable(scalar, causality, "Real", unit, doc, start)
            for causality, group, start in groups
            for name, (size, unit, doc) in group.items()
            for scalar in scalar_names(name, size)
        ]
        return table + [
            Variable(name, "parameter", it.kind, it.unit, it.doc, it.value, it.minimum, it.maximum) for name, it in self.parameters.items()
        ]
