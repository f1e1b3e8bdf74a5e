"""A unit as an FMI 2.0 co-simulation slave: ports, parameters, state and errors; no physics.

Travels inside every exported FMU (relative imports only) and drives any class of the unit protocol: PARAMETERS,
INPUTS, outputs(), initialize(), step(), output(), state (a tree of tuples, numbers and arrays, which has the layout of all
states from the unit's making on), and where there is one `remark`, what the log should say, line by line, of a step that was done;
RANGES of its ports and their nominal() values by unit of measure, COUNTS, the outputs that are integers. Answers to the host (see
`failure`):
  - a step that does not converge, meets an input that is not finite, or is asked for out of order: logged, discard,
    the unit stands where it stood before;
  - a step of no length or beyond a defined stop time, a refused parameter or initialisation, and a bug: fmi2Error with the
    message, the unit stands where it stood, the process lives on.
Statics and everything else that initialisation costs is done when the first output is asked for, or at the end of
initialisation mode.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.default_experiment import DefaultExperiment
from pythonfmu.enums import Fmi2Status

from . import schema
from .description import Variable, fill
from .failure import Refused, guarded, printable, where
from .ports import KINDS, Ports, PortTable, Run
from .state import Snapshot, read_header, rebuild, to_bytes

CONFIGURATION = "configuration"
PHASES = ("not initialised", "initialising", "initialised", "terminated")
START = "start."  # before the name of a parameter that has the name of a port, whose start value it is
BROKEN_ARITHMETIC = (ArithmeticError, ValueError, np.linalg.LinAlgError)  # a failed step, not a bug
TIME_TOLERANCE = 1e-6  # of a step: hosts add up their time in ways of their own
TIME_ROUNDING = 1e-12  # of the time, however short the step: what round-off makes of the sum of 50,000 steps


def _getter(kind: str) -> Callable[[UnitSlave, list[int]], list[Any]]:
    return guarded(lambda slave, vrs: slave._get(kind, vrs))


def _setter(kind: str) -> Callable[[UnitSlave, list[int], list[Any]], None]:
    return guarded(lambda slave, vrs, values: slave._set(kind, vrs, values))


class UnitSlave(Fmi2Slave):
    """Base class of the slave in an FMU's entry script; `unit_class` is the unit it carries."""

    unit_class: ClassVar[Any]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        about = json.loads(Path(self.resources, "fmu.json").read_text(encoding="utf-8"))
        self.description = self.unit_class.DESCRIPTION
        for name, value in about["about"].items():  # modelName, guid, author, license, version, description
            setattr(self, name, value)
        self.default_experiment = DefaultExperiment(**about["experiment"]) if about["experiment"] else None
        self._nominal = about["nominal"]  # by port, before those by unit of measure
        self.parameters = schema.build(self.unit_class.PARAMETERS, about["parameters"])
        inputs, outputs = self.unit_class.INPUTS, self.unit_class.outputs(self.parameters)
        fields, taken = schema.flatten(self.parameters), {*inputs, *outputs}
        self._fields = {(START if name.partition("[")[0] in taken else "") + name: name for name in fields}
        flat = {name: fields[own] for name, own in self._fields.items()}
        flat[CONFIGURATION] = schema.Parameter("String", "", doc="All parameters as JSON; empty: the built-in ones")
        self.ports = Ports(inputs, outputs, flat, about["inputs"], getattr(self.unit_class, "COUNTS", ()))
        self.inputs = self.ports.start.copy()
        self._run_of_inputs = list(range(self.ports.n_inputs))
        self.changed: Mapping[str, Any] = {}  # parameters set by the host; replaced, never mutated
        self.phase, self.time, self.stop = PHASES[0], 0.0, math.inf
        self.unit: Any = None
        self._runs: dict[tuple[object, ...], list[Run]] = {}

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """PythonFMU's frame, completed."""
        root = super().to_xml(model_options or {})
        root.set("generationTool", f"pipelay {self.version} with {root.get('generationTool')}")
        fill(root, self.variables())
        return root

    def variables(self) -> list[Variable]:
        """Scalar variables in the order of their value references."""
        unit = self.unit_class
        nominal = (unit.nominal(self.parameters) if hasattr(unit, "nominal") else {}) | self._nominal
        return self.ports.variables(getattr(unit, "RANGES", {}), nominal)

    def own_name(self, name: str) -> str:
        """The unit's own name of a parameter, "" of one that it does not know."""
        return self._fields.get(name, "")

    # life cycle

    @guarded
    def setup_experiment(self, start_time: float, stop_time: float | None = None, tolerance: float | None = None) -> None:
        self._expect("not initialised", "set-up of the experiment")
        if not math.isfinite(start_time):
            raise Refused(f"start time = {start_time}: must be finite")
        if stop_time is not None and not stop_time >= start_time:
            raise Refused(f"stop time = {stop_time}: must be >= the start time, {start_time} s")
        self.time, self.stop = start_time, math.inf if stop_time is None else stop_time

    @guarded
    def enter_initialization_mode(self) -> None:
        self._expect("not initialised", "initialisation mode")
        self.phase = "initialising"

    @guarded
    def exit_initialization_mode(self) -> None:
        self._expect("initialising", "end of initialisation mode")
        try:
            self._ready()
        except Exception:
            self.phase = "not initialised"  # for another try with better parameters
            raise
        self.phase = "initialised"
        self._warn()

    @guarded
    def terminate(self) -> None:
        self._expect("initialised", "terminate")
        self.phase = "terminated"

    def _expect(self, phase: str, call: str) -> None:
        if self.phase != phase:
            raise Refused(f"{call}: the FMU is {self.phase}")

    @guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        message = self._step(current_time, step_size)
        if message is not None:
            self.log(printable(message), Fmi2Status.discard)
        else:
            self._warn()
        return message is None

    def _warn(self) -> None:
        for remark in getattr(self.unit, "remark", "").splitlines():
            self.log(printable(remark), Fmi2Status.warning)

    def _step(self, time: float, step: float) -> str | None:
        if self.phase != "initialised":
            return f"step at {time:.9g} s: the FMU is {self.phase}"
        if not (math.isfinite(time) and math.isfinite(step) and step > 0.0):
            raise Refused(f"step of {step} s at {time} s: must be finite, and the step > 0 s")
        tolerance = max(TIME_TOLERANCE * step, TIME_ROUNDING * abs(time))
        if abs(time - self.time) > tolerance:
            return f"time = {time!r}: the FMU stands at {self.time!r} s"
        if time + step > self.stop + tolerance:
            raise Refused(f"step to {time + step!r} s: the stop time is {self.stop!r} s")
        held = self.ports.held(self.inputs)
        before = self.unit.state
        try:
            message = self.ports.not_finite(self.inputs) or self.unit.step(time, step, held)
        except BROKEN_ARITHMETIC as error:
            message = where(error)
        if message is None:
            self.time = time + step
        else:
            self.unit.state = before
        return message

    # variables

    get_real, get_integer, get_boolean, get_string = (_getter(kind) for kind in KINDS)
    set_integer, set_boolean, set_string = (_setter(kind) for kind in KINDS[1:])

    @guarded
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        first, last = (vrs[0], vrs[-1]) if vrs else (0, -1)
        if self.phase == "initialised" and vrs == self._run_of_inputs[first : last + 1]:  # the usual case
            self.inputs[first : last + 1] = values
        else:
            self._set("Real", vrs, values)

    def _get(self, kind: str, vrs: list[int]) -> list[Any]:
        key = (kind, *vrs)
        runs = self._runs.get(key)
        if runs is None:  # hosts repeat themselves: the runs of a request are found once
            runs = self._runs[key] = list(self.ports.runs(vrs, kind))
        return self._read(runs[0]) if len(runs) == 1 else [value for run in runs for value in self._read(run)]

    def _set(self, kind: str, vrs: list[int], values: Sequence[Any]) -> None:
        """All of them or, where one is refused, none."""
        inputs, changed = self.inputs.copy(), dict(self.changed)
        for vr, value in zip(vrs, values, strict=True):
            causality, name, _ = self.ports.place(vr, kind)
            if causality == "output":
                raise Refused(f"{self.ports.scalar(vr)} = {value}: an output cannot be set")
            if self.phase == "terminated":
                raise Refused(f"{self.ports.scalar(vr)} = {value}: the FMU is terminated")
            if causality == "input":
                inputs[vr] = value
            elif self.phase == "initialised":
                raise Refused(f"{name} = {value}: a parameter cannot be set after initialisation")
            else:
                changed[name] = self.ports.as_item(name, value)
                self.ports.check_parameter(name, changed[name])
        self.inputs[:], self.changed = inputs, changed
        if self.phase != "initialised":
            self.unit = None

    def _read(self, run: Run) -> list[Any]:
        causality, name, part = run
        if causality == "output":
            unit = self.unit
            values = (self._ready() if unit is None else unit).output(name)[part].tolist()
            return [int(value) for value in values] if name in self.ports.counts else values
        if causality == "input":
            return self.inputs[self.ports.input_slices[name]][part].tolist()
        return [self.ports.as_number(name, self.changed.get(name, self.ports.parameters[name].value))]

    # state

    @guarded
    def _get_fmu_state(self) -> Snapshot:
        unit = None if self.unit is None else self.unit.state
        return Snapshot(self.guid, self.phase, self.time, self.changed, self.inputs.copy(), unit)

    @guarded
    def _set_fmu_state(self, state: Snapshot) -> None:
        if state.guid != self.guid:
            raise Refused(f"state: of another FMU, with the GUID {state.guid}")
        if state.unit is None or (state.changed is not self.changed and state.changed != self.changed):
            self.unit = None
        self.phase, self.time, self.changed = state.phase, state.time, state.changed
        self.inputs[:] = state.inputs
        if state.unit is not None:
            if self.unit is None:
                self.unit = self._make_unit(self.changed)
            self.unit.state = state.unit

    @guarded
    def _fmu_state_to_bytes(self, state: Snapshot) -> bytes:
        return to_bytes(state)

    @guarded
    def _fmu_state_from_bytes(self, data: bytes) -> Snapshot:
        header, values = read_header(data)
        guid, phase, changed, layout = (header[key] for key in ("guid", "phase", "changed", "layout"))
        if guid != self.guid:
            raise Refused(f"state: of another FMU, with the GUID {guid}")
        for name, value in changed.items():
            self.ports.check_parameter(name, value)
        bare = len(layout) <= 1  # the inputs alone: nothing was initialised
        if phase not in (PHASES[1:2] if bare else PHASES[1:]) and (phase, bare) != (PHASES[0], True):
            raise Refused(f"state: cannot be read back: it is {phase}, {'without' if bare else 'with'} the state of a unit")
        unit = None if bare else self.unit if self.unit is not None and changed == self.changed else self._make_unit(changed)
        inputs, state = rebuild((self.inputs, None if unit is None else unit.state), layout, values)
        return Snapshot(guid, phase, header["time"], changed, inputs, state)

    # inside

    def _ready(self) -> Any:
        """The initialised unit; made when first asked for, anew when something was set since."""
        if self.unit is None:
            if self.phase == "not initialised":
                raise Refused("outputs: not defined before initialisation")
            unit = self._make_unit(self.changed)
            message = self.ports.not_finite(self.inputs) or unit.initialize(self.time, self.ports.held(self.inputs))
            if message is not None:
                raise Refused(message)
            self.unit = unit
        return self.unit

    def _make_unit(self, changed: Mapping[str, Any]) -> Any:
        changes = dict(changed)
        text = changes.pop(CONFIGURATION, "")
        tree = schema.from_json(self.unit_class.PARAMETERS, text) if text else self.parameters
        tree = schema.override(tree, {self._fields[name]: value for name, value in changes.items()})
        self._expect_outputs(self.unit_class.outputs(tree), changed)
        return self.unit_class(tree)

    def _expect_outputs(self, given: PortTable, changed: Mapping[str, Any]) -> None:
        """An energy that the FMU has no output for would be missing from the balance, unseen."""
        there = self.ports.outputs
        for name in {**there, **given}:
            if name not in there or name not in given or given[name][0] != there[name][0]:
                cause = ", ".join(key for key, value in changed.items() if value != self.ports.parameters[key].value)
                verb = "changes" if name in there else "adds"
                raise Refused(f"{cause}: {verb} the output {name}; such an FMU must be exported anew")
