"""One FMU instance behind named ports: FMPy loads it, errors come back typed and with the FMU's own words.

A port is a variable, or all of ``name[1]`` .. ``name[n]``. Value references are looked up once per set of names; the
calls of the time loop go straight to the FMU's functions with arrays kept for the purpose (a get or set of six reals
takes about 5 us).
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import ArrayLike, NDArray

from .errors import STEP_FAILURES, FmuError, FmuFailed
from .loading import free, instantiated, read
from .messages import last_words, log, spoken
from .ports import Port, read_ports

Names = str | tuple[str, ...]


class _Channel(NamedTuple):
    """Value references and values of some ports, as the FMU's functions want them."""

    references: Any
    size: int
    pointer: Any
    values: NDArray[np.float64]


class Fmu:
    """An instance of the FMU file `path`. A context manager: leaving it frees states, instance and unpacked files.

    Raises FmuFailed where the FMU, or FMPy, refuses.
    """

    def __init__(self, path: str | Path, instance_name: str = "") -> None:
        model = read(path)
        self.path, self.messages = Path(path), log()
        self.name, self.guid = instance_name or model.modelName, model.guid
        self.ports = read_ports(model)
        self.can_rollback = bool(model.coSimulation.canGetAndSetFMUstate)
        self.has_derivatives = bool(model.coSimulation.providesDirectionalDerivative)
        self.can_vary_step = bool(model.coSimulation.canHandleVariableCommunicationStepSize)
        self._fmu, folder = instantiated(path, model, self.name, self.messages)
        self._states: set[int] = set()
        self.remark = ""  # the FMU's warnings about its start, or about its last step, a line each
        self._close = weakref.finalize(self, free, self._fmu, self._states, folder)  # at exit at the latest
        self._component = ctypes.c_void_p(self._fmu.component)
        self._channels: dict[Names, _Channel] = {}
        # function objects of our own: FMPy's check and convert every argument
        self._get_real, self._set_real, self._do_step, self._get_state, self._set_state, self._free_state = (
            self._fmu.dll[f"fmi2{name}"] for name in ("GetReal", "SetReal", "DoStep", "GetFMUstate", "SetFMUstate", "FreeFMUstate")
        )

    # life cycle

    def initialize(
        self,
        parameters: Mapping[str, Any] | None = None,
        start_time: float = 0.0,
        inputs: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        """Set parameters (ports; a vector takes a sequence) and inputs, and go through initialisation mode."""
        self._call("setup", self._fmu.setupExperiment, startTime=start_time)
        for name, value in (parameters or {}).items():
            self._set_parameter(name, value)
        self._call("initialisation", self._fmu.enterInitializationMode)
        for name, value in (inputs or {}).items():
            self.set(name, value)
        self._call("initialisation", self._fmu.exitInitializationMode)
        self.remark = "\n".join(spoken(self.messages)) if self.messages else ""

    def close(self) -> None:
        """Free every state, the instance and the unpacked files; safe to call twice."""
        self._close()

    def __enter__(self) -> Fmu:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    # ports

    def get(self, names: Names) -> NDArray[np.float64]:
        """Values of one port or of several, concatenated; those of integer ports as real numbers."""
        channel = self._channels.get(names)
        if channel is None:
            every = (names,) if isinstance(names, str) else names
            if any(self.port(name).kind == "Integer" for name in every):
                return np.concatenate([self._integers(name) if self.port(name).kind == "Integer" else self.get(name) for name in every])
            channel = self._channel(names)
        if self._get_real(self._component, channel.references, channel.size, channel.pointer) > 1:
            raise self._failure(f"get {names}")
        return channel.values.copy()

    def set(self, names: Names, values: ArrayLike) -> None:
        """Set one real port or several at once, concatenated."""
        channel = self._channels.get(names) or self._channel(names)
        channel.values[:] = values
        if self._set_real(self._component, channel.references, channel.size, channel.pointer) > 1:
            raise self._failure(f"set {names}")

    def derivatives(self, results: Names, held: Names) -> NDArray[np.float64]:
        """d(results)/d(held) by the FMU's directional derivatives, one call a column."""
        unknown, known = (list(self._channel(names).references) for names in (results, held))
        columns = [self._call("directional derivative", self._fmu.getDirectionalDerivative, unknown, [one], [1.0]) for one in known]
        return np.array(columns).T

    def names(self, causality: str) -> list[str]:
        """Names of the ports with this causality: input, output, parameter."""
        return [port.name for port in self.ports.values() if port.causality == causality]

    def port(self, name: str) -> Port:
        """The port of this name. Raises FmuFailed, naming the ports there are."""
        if name not in self.ports:
            known = self.names("input") + self.names("output")
            raise FmuFailed(f"{self.name}: has no port {name!r}; inputs and outputs: {', '.join(known)}")
        return self.ports[name]

    # time

    def step(self, time: float, step: float, final: bool = False) -> None:
        """One communication step; `final` promises the FMU that nobody will roll back before `time`.

        Raises StepRejected if the FMU discards the step, FmuFailed if it breaks down.
        """
        self.messages.clear()
        status = self._do_step(self._component, ctypes.c_double(time), ctypes.c_double(step), final)
        if status > 1:
            raise self._failure(f"step of {step:.6g} s at {time:.9g} s", STEP_FAILURES.get(status, FmuFailed))
        self.remark = "\n".join(spoken(self.messages)) if self.messages else ""

    def snapshot(self) -> ctypes.c_void_p:
        """A handle to the FMU's whole state, for `restore`; freed by `release` or `close`."""
        state = ctypes.c_void_p()
        if self._get_state(self._component, ctypes.byref(state)) > 1 or state.value is None:
            raise self._failure("save state")
        self._states.add(state.value)
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        """Go back to a saved state, exactly."""
        if self._set_state(self._component, state) > 1:
            raise self._failure("restore state")

    def release(self, state: ctypes.c_void_p) -> None:
        """Free a saved state."""
        assert state.value is not None
        self._states.remove(state.value)
        if self._free_state(self._component, ctypes.byref(state)) > 1:
            raise self._failure("free state")

    def serialize(self, state: ctypes.c_void_p) -> bytes:
        """The saved state as bytes, to be read by `deserialize` of any instance of the same FMU."""
        return self._call("serialise state", self._fmu.serializeFMUstate, state)

    def deserialize(self, data: bytes) -> ctypes.c_void_p:
        """A handle to the state in `data`."""
        state = self._call("read state", self._fmu.deSerializeFMUstate, data)
        self._states.add(state.value)
        return state

    # inside

    def _integers(self, name: str) -> NDArray[np.float64]:
        return np.array(self._call(f"get {name}", self._fmu.getInteger, self.port(name).references), dtype=float)

    def _channel(self, names: Names) -> _Channel:
        ports = [self.port(name) for name in ((names,) if isinstance(names, str) else names)]
        if any(port.kind != "Real" for port in ports):
            raise FmuFailed(f"{self.name}: {names} is not a real port")
        references = [reference for port in ports for reference in port.references]
        values = np.zeros(len(references))
        pointer = values.ctypes.data_as(ctypes.c_void_p)
        channel = _Channel((ctypes.c_uint * len(references))(*references), len(references), pointer, values)
        self._channels[names] = channel
        return channel

    def _set_parameter(self, name: str, value: Any) -> None:
        if name not in self.ports:
            raise FmuFailed(f"{self.name}: has no parameter {name!r}; there are {', '.join(self.names('parameter'))}")
        port = self.ports[name]
        values = list(value) if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) else [value]
        if len(values) != port.size:
            raise FmuFailed(f"{self.name}: {name} = {value}: must have {port.size} values")
        kind = "Integer" if port.kind == "Enumeration" else port.kind
        try:
            numbers = [dict(port.items).get(value, value) for value in values]
            self._call(f"set {name}", getattr(self._fmu, f"set{kind}"), port.references, numbers)
        except (TypeError, AttributeError):  # of ctypes and FMPy
            rule = f"one of {', '.join(item for item, _ in port.items)}" if port.items else f"of type {port.kind}"
            raise FmuFailed(f"{self.name}: {name} = {value}: must be {rule}") from None

    def _call(self, what: str, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        try:
            return function(*arguments, **options)
        except FMICallException:
            raise self._failure(what) from None

    def _failure(self, what: str, kind: type[FmuError] = FmuFailed) -> FmuError:
        words = last_words(self.messages, "no message")
        if words == "interrupted":  # Ctrl-C reached the FMU first
            raise KeyboardInterrupt
        return kind(f"{self.name}: {what}: {words}")
