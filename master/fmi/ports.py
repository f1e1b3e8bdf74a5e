"""Value references of a unit: inputs first, then outputs, then parameters, scalar by scalar."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .description import Variable, scalar_names
from .schema import Parameter

KINDS = ("Real", "Integer", "Boolean", "String")  # of FMI variables; ports are real, or counts
_TYPES = dict(zip((*KINDS, "Enumeration"), (float, int, bool, str, str), strict=True))
LONGEST_TEXT = 10_000_000  # characters; a table of all nodes takes a fifth of it
PortTable = Mapping[str, tuple[int, str | Sequence[str], str]]  # name -> (size, unit or those of the components, description)
Ranges = Mapping[str, tuple[float | None, float | None]]  # port -> least and largest value


def finite(values: NDArray[np.float64]) -> bool:
    """Whether all values (n,) are finite."""
    return math.isfinite(values @ values) or bool(np.isfinite(values).all())  # the first is quicker, the second knows of overflow


class Run(NamedTuple):
    """Consecutive value references that belong to one port (or one parameter)."""

    causality: str
    name: str
    part: slice


class Ports:
    """The variables of one unit with one set of parameters."""

    def __init__(
        self,
        inputs: PortTable,
        outputs: PortTable,
        parameters: Mapping[str, Parameter],
        start: Mapping[str, Sequence[float]] | None = None,
        counts: Collection[str] = (),
    ) -> None:
        self.counts = frozenset(counts)  # outputs that are integers
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
        self.start = self._start(start or {})

    def _start(self, given: Mapping[str, Sequence[float]]) -> NDArray[np.float64]:
        """Start values (n_inputs,) of the inputs: those given by name, else zero. Raises ValueError for a name or size that is wrong."""
        values = np.zeros(self.n_inputs)
        for name, value in given.items():
            if name not in self.inputs or len(value) != self.inputs[name][0]:
                raise ValueError(f"{name} = {list(value)}: must be an input of that many values; there are {', '.join(self.inputs)}")
            values[self.input_slices[name]] = value
        return values

    def place(self, reference: int, kind: str = "Real") -> tuple[str, str, int]:
        """(causality, name, index in the port) of a value reference. Raises ValueError if there is none of that kind.

        A count is given as a real number too, as hosts that read every output as such (CoFmuPy) ask for it.
        """
        if not 0 <= reference < len(self._places):
            raise ValueError(f"value reference = {reference}: must be below {len(self._places)}")
        causality, name, _ = place = self._places[reference]
        own = self.parameters[name].kind if causality == "parameter" else "Integer" if name in self.counts else "Real"
        if kind != ("Integer" if own == "Enumeration" else own) and not (causality == "output" and kind == "Real"):
            raise ValueError(f"{self.scalar(reference)}: asked for as {kind}, is {own}")
        return place

    def scalar(self, reference: int) -> str:
        """Name of the variable at a value reference: that of the port, with its index where there are several."""
        causality, name, i = self._places[reference]
        size = {"input": self.inputs, "output": self.outputs}[causality][name][0] if causality != "parameter" else 1
        return scalar_names(name, size)[i]

    def check_parameter(self, name: str, value: Any) -> None:
        """Raise ValueError where `value` cannot be that of the parameter `name`; its range is the unit's business."""
        if name not in self.parameters or type(value) is not _TYPES[self.parameters[name].kind]:
            raise ValueError(f"{name} = {value!r:.80}: must be a parameter, and a value of its type")
        if (items := self.parameters[name].items) and value not in items:
            raise ValueError(f"{name} = {value!r:.80}: must be one of {', '.join(map(repr, items))}")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name} = {value}: must be finite")
        if isinstance(value, str) and len(value) > LONGEST_TEXT:
            raise ValueError(f"{name}: has {len(value)} characters, must have at most {LONGEST_TEXT}")

    def as_item(self, name: str, value: Any) -> Any:
        """What the host's `value` means: of an enumeration the name of the item with that number, else itself. Raises ValueError."""
        items = self.parameters[name].items
        if items and not 1 <= value <= len(items):
            numbers = ", ".join(f"{i} ({item})" for i, item in enumerate(items, 1))
            raise ValueError(f"{name} = {value}: must be one of {numbers}")
        return items[value - 1] if items else value

    def as_number(self, name: str, value: Any) -> Any:
        """Inverse of `as_item`."""
        items = self.parameters[name].items
        return items.index(value) + 1 if items else value

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
        if finite(inputs):
            return None
        bad = next(i for i, value in enumerate(inputs) if not math.isfinite(value))
        return f"{self.scalar(bad)} = {inputs[bad]}: must be finite"

    def variables(self, ranges: Ranges, nominal: Mapping[str, float]) -> list[Variable]:
        """Scalar variables for the model description, by value reference; `nominal` values by port or unit of measure."""
        ports, table = self.inputs | self.outputs, []
        for reference, (causality, name, i) in enumerate(self._places):
            if causality == "parameter":
                it = self.parameters[name]
                value = self.as_number(name, it.value)
                table.append(Variable(name, causality, it.kind, it.unit, it.doc, value, it.minimum, it.maximum, items=it.items))
                continue
            size, units, doc = ports[name]
            bounds = ranges.get(name, (None, None))
            if name in self.counts:  # FMI knows neither unit nor nominal value of these
                least, most = (None if bound is None else int(bound) for bound in bounds)
                table.append(Variable(scalar_names(name, size)[i], causality, "Integer", "", doc, None, least, most))
                continue
            unit = units if isinstance(units, str) else units[i]
            start = float(self.start[reference]) if causality == "input" else None
            size_of = nominal.get(name, nominal.get(unit))
            table.append(Variable(scalar_names(name, size)[i], causality, "Real", unit, doc, start, *bounds, size_of))
        return table
