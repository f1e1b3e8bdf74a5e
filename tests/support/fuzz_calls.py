"""Random FMI calls, right and wrong, on two instances of one FMU; run as a program: ``fuzz_calls.py FMU SEED SECONDS``.

The calls go to a journal on the error stream before they are made, so that a crash leaves them behind. Ends with exit code 1 where a
wrong call is answered with fmi2OK, an error has no message, a refused step moved the unit, or a restored state is not the one that was
saved. Prints the number of calls and of steps done.
"""

from __future__ import annotations

import ctypes
import random
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import fmpy
from fmpy import fmi2

from master.fmi.ports import LONGEST_TEXT

OK, DISCARD, ERROR = 0, 2, 3
GOOD, BAD = (OK,), (DISCARD, ERROR)
BATCH = 150  # calls on one pair of instances
STEP = 0.1  # s
Answer = tuple[int, tuple[int, ...]]  # status, and those that are right


class WrongError(Exception):
    """An answer that the standard, or the unit's own promise, does not allow."""


class State(NamedTuple):
    """What was saved, and what the unit must be when it is restored."""

    pointer: int
    phase: str
    time: float
    outputs: list[float]


class Caller:
    """One instance and what may be asked of it; `other` is a second one of the same FMU."""

    other: Caller

    def __init__(self, path: str, folder: str) -> None:
        model = fmpy.read_model_description(path, validate=False)
        self.messages: list[bytes] = []
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *words: self.messages.append(words[-1]))
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        identifier = model.coSimulation.modelIdentifier
        self.fmu = fmi2.FMU2Slave(guid=model.guid, modelIdentifier=identifier, unzipDirectory=folder, instanceName="f")
        self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
        self.component = ctypes.c_void_p(self.fmu.component)
        self.variables = model.modelVariables
        self.outputs = [v.valueReference for v in self.variables if v.causality == "output"]
        self.time, self.phase, self.steps = 0.0, "instantiated", 0
        self.states: list[State] = []
        self.freed: list[int] = []

    def call(self, name: str, *arguments: object) -> int:
        return int(self.fmu.dll[f"fmi2{name}"](self.component, *arguments))

    def reals(self, name: str, reference: int, value: float = 0.0) -> int:
        return self.call(name, (ctypes.c_uint * 1)(reference), 1, (ctypes.c_double * 1)(value))

    def reference(self, causality: str, kind: str = "Real") -> int:
        return int(random.choice([v.valueReference for v in self.variables if v.causality == causality and v.type == kind]))

    def all_outputs(self) -> list[float]:
        if self.phase != "stepping":
            return []
        n = len(self.outputs)
        values = (ctypes.c_double * n)()
        if self.call("GetReal", (ctypes.c_uint * n)(*self.outputs), n, values):
            raise WrongError("outputs cannot be read")
        return list(values)

    def refused_step(self, start: float, length: float) -> Answer:
        """A step that must be refused, and must leave the unit where it is."""
        before = self.all_outputs()
        status = self.call("DoStep", ctypes.c_double(start), ctypes.c_double(length), 0)
        if self.all_outputs() != before:
            raise WrongError("a refused step moved the unit")
        return status, BAD

    # the moves: each answers (status, statuses allowed)

    def initialize(self) -> Answer:
        if self.phase != "instantiated":
            name = random.choice(["EnterInitializationMode", "ExitInitializationMode"])
            return self.call(name), BAD
        done = self.call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(0.0), 0, ctypes.c_double(0.0))
        done = max(done, self.call("EnterInitializationMode"), self.call("ExitInitializationMode"))
        self.phase, self.time = "stepping", 0.0
        return done, GOOD

    def set_up_badly(self) -> Answer:
        start = float("nan") if self.phase == "instantiated" else 0.0
        return self.call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(start), 0, ctypes.c_double(0.0)), BAD

    def step(self) -> Answer:
        status = self.call("DoStep", ctypes.c_double(self.time), ctypes.c_double(STEP), 0)
        if self.phase != "stepping":
            return status, BAD
        if status == OK:
            self.time += STEP
            self.steps += 1
        return status, (OK, DISCARD)  # inputs may be wild

    def step_badly(self) -> Answer:
        nan, far = float("nan"), self.time + 3.0
        return self.refused_step(*random.choice([(self.time, -STEP), (self.time, 0.0), (self.time, nan), (nan, STEP), (far, STEP)]))

    def step_with_nan(self) -> Answer:
        if self.phase != "stepping":
            return self.refused_step(self.time, STEP)
        reference = self.reference("input")
        self.reals("SetReal", reference, random.choice([float("nan"), float("inf")]))
        answer = self.refused_step(self.time, STEP)
        self.reals("SetReal", reference, 0.0)
        return answer

    def push(self) -> Answer:
        value = random.uniform(-1.0, 1.0) * 10.0 ** random.choice([-3, 0, 0, 3, 9])
        status = self.reals("SetReal", self.reference("input"), value)
        return status, GOOD if self.phase != "terminated" else BAD

    def calm(self) -> Answer:
        references = [v.valueReference for v in self.variables if v.causality == "input"]
        n = len(references)
        status = self.call("SetReal", (ctypes.c_uint * n)(*references), n, (ctypes.c_double * n)())
        return status, GOOD if self.phase != "terminated" else BAD

    def read(self) -> Answer:
        return self.reals("GetReal", self.reference("output")), BAD if self.phase == "instantiated" else GOOD

    def read_unknown(self) -> Answer:
        return self.reals("GetReal", random.choice([10**6, 2**31 - 1, 2**32 - 1])), BAD

    def set_unknown(self) -> Answer:
        return self.reals("SetReal", random.choice([10**6, 2**31 - 1, 2**32 - 1])), BAD

    def read_as_another_type(self) -> Answer:
        name, place = random.choice([("Integer", ctypes.c_int), ("Boolean", ctypes.c_int), ("String", ctypes.c_char_p)])
        return self.call(f"Get{name}", (ctypes.c_uint * 1)(self.reference("input")), 1, (place * 1)()), BAD

    def set_as_another_type(self) -> Answer:
        name, value = random.choice([("Integer", ctypes.c_int(1)), ("Boolean", ctypes.c_int(1)), ("String", ctypes.c_char_p(b"1"))])
        return self.call(f"Set{name}", (ctypes.c_uint * 1)(self.reference("input")), 1, (type(value) * 1)(value)), BAD

    def set_text_as_number(self) -> Answer:
        return self.reals("SetReal", self.reference("parameter", "String"), 1.0), BAD

    def set_output(self) -> Answer:
        return self.reals("SetReal", self.reference("output"), 1.0), BAD

    def set_no_number(self) -> Answer:
        return self.reals("SetReal", self.reference("parameter"), float("nan")), BAD

    def without_arrays(self) -> Answer:
        name = random.choice(["GetReal", "SetReal", "GetString", "SetString"])
        return self.call(name, None, 3, None), BAD

    def set_long_text(self) -> Answer:
        reference = next(v.valueReference for v in self.variables if v.name == "configuration")
        text = (ctypes.c_char_p * 1)(b"%s{" * 50000)
        status = self.call("SetString", (ctypes.c_uint * 1)(reference), 1, text)
        if self.phase == "instantiated":  # refused when it is read
            self.call("SetString", (ctypes.c_uint * 1)(reference), 1, (ctypes.c_char_p * 1)(b""))
            return status, (*GOOD, *BAD)
        return status, BAD

    def set_too_long_text(self) -> Answer:
        reference = next(v.valueReference for v in self.variables if v.name == "configuration")
        text = (ctypes.c_char_p * 1)(b" " * (LONGEST_TEXT + 1))
        return self.call("SetString", (ctypes.c_uint * 1)(reference), 1, text), BAD

    def derivatives(self) -> Answer:
        one, value = (ctypes.c_uint * 1)(0), (ctypes.c_double * 1)()
        return self.call("GetDirectionalDerivative", one, 1, one, 1, value, value), BAD

    def save(self) -> Answer:
        pointer = ctypes.c_void_p()
        status = self.call("GetFMUstate", ctypes.byref(pointer))
        self.states.append(State(pointer.value or 0, self.phase, self.time, self.all_outputs()))
        return status, GOOD

    def save_over(self) -> Answer:
        """Into the place of a state that is there."""
        if not self.states:
            return self.call("GetFMUstate", None), BAD
        old = self.states.pop(random.randrange(len(self.states)))
        pointer = ctypes.c_void_p(old.pointer)
        status = self.call("GetFMUstate", ctypes.byref(pointer))
        self.states.append(State(pointer.value or 0, self.phase, self.time, self.all_outputs()))
        return status, GOOD

    def restore(self) -> Answer:
        if not self.states:
            return self.call("SetFMUstate", None), BAD
        state = random.choice(self.states)
        status = self.call("SetFMUstate", ctypes.c_void_p(state.pointer))
        self.phase, self.time = state.phase, state.time
        if self.all_outputs() != state.outputs:
            raise WrongError("the state restored is not the state saved")
        return status, GOOD

    def copy(self) -> Answer:
        """Through bytes into a new state."""
        if not self.states:
            return self.call("SerializedFMUstateSize", None, ctypes.byref(ctypes.c_size_t())), BAD
        state = random.choice(self.states)
        data, pointer = self._bytes(state.pointer), ctypes.c_void_p()
        status = self.call("DeSerializeFMUstate", data, len(data), ctypes.byref(pointer))
        self.states.append(state._replace(pointer=pointer.value or 0))
        return status, GOOD

    def copy_damaged(self) -> Answer:
        data = self._bytes(random.choice(self.states).pointer) if self.states else random.randbytes(300)
        place, cut = random.randrange(len(data)), random.randrange(len(data))
        changed = bytes([data[place] ^ random.randrange(1, 256)])
        data = random.choice([data[:place] + changed + data[place + 1 :], data[:cut], data + b"more", random.randbytes(64), b""])
        pointer = ctypes.c_void_p()
        return self.call("DeSerializeFMUstate", data, len(data), ctypes.byref(pointer)), BAD

    def copy_into_wrong_room(self) -> Answer:
        pointer = ctypes.c_void_p(self.states[0].pointer if self.states else 12345)
        size = random.choice([0, 1, 100, 10**5])
        return self.call("SerializeFMUstate", pointer, ctypes.create_string_buffer(size + 1), ctypes.c_size_t(size)), BAD

    def copy_to_nowhere(self) -> Answer:
        pointer = ctypes.c_void_p(self.states[0].pointer if self.states else 12345)
        size = len(self._bytes(pointer.value or 0)) if self.states else 7
        return self.call("SerializeFMUstate", pointer, None, ctypes.c_size_t(size)), BAD

    def free(self) -> Answer:
        if not self.states:
            return self.call("FreeFMUstate", ctypes.byref(ctypes.c_void_p())), GOOD  # nothing to free: ignored
        state = self.states.pop(random.randrange(len(self.states)))
        self.freed.append(state.pointer)
        return self.call("FreeFMUstate", ctypes.byref(ctypes.c_void_p(state.pointer))), GOOD

    def free_twice(self) -> Answer:
        return self.call("FreeFMUstate", ctypes.byref(self._stale())), BAD

    def restore_freed(self) -> Answer:
        return self.call("SetFMUstate", self._stale()), BAD

    def restore_of_another(self) -> Answer:
        theirs = self.other.states
        return self.call("SetFMUstate", ctypes.c_void_p(theirs[0].pointer) if theirs else self._stale()), BAD

    def copy_freed(self) -> Answer:
        size = ctypes.c_size_t()
        return self.call("SerializedFMUstateSize", self._stale(), ctypes.byref(size)), BAD

    def _stale(self) -> ctypes.c_void_p:
        """A freed state, an address of nothing, or a small number."""
        return ctypes.c_void_p(random.choice([*self.freed[-3:], id(self), 2**63]))

    def _bytes(self, pointer: int) -> bytes:
        size = ctypes.c_size_t()
        if self.call("SerializedFMUstateSize", ctypes.c_void_p(pointer), ctypes.byref(size)):
            raise WrongError("no size of a good state")
        data = ctypes.create_string_buffer(size.value)
        if self.call("SerializeFMUstate", ctypes.c_void_p(pointer), data, size):
            raise WrongError("no bytes of a good state")
        return data.raw

    def terminate(self) -> Answer:
        if random.random() < 0.7:  # not too often
            return OK, GOOD
        status, was = self.call("Terminate"), self.phase
        if was != "stepping":
            return status, BAD
        self.phase = "terminated"
        return status, GOOD

    def reset(self) -> Answer:
        if random.random() < 0.7:
            return OK, GOOD
        self.phase, self.time = "instantiated", 0.0
        return self.call("Reset"), GOOD

    def close(self) -> None:
        for state in self.states[::2]:  # the others are the FMU's to free
            self.call("FreeFMUstate", ctypes.byref(ctypes.c_void_p(state.pointer)))
        self.fmu.dll.fmi2FreeInstance(self.component)


MOVES = [name for name, it in vars(Caller).items() if callable(it) and it.__annotations__.get("return") == "Answer"]
MOVES.remove("refused_step")
USUAL = ["initialize", "push", "calm", "step", "step", "step"] * 3  # else an instance hardly ever gets to a step


def call_dead(dll: Any, component: ctypes.c_void_p) -> None:
    """Calls on an instance that was freed: refused, without a logger to say so."""
    calls: list[Callable[[], int]] = [
        lambda: dll.fmi2DoStep(component, ctypes.c_double(0.0), ctypes.c_double(STEP), 0),
        lambda: dll.fmi2Terminate(component),
        lambda: dll.fmi2GetFMUstate(component, ctypes.byref(ctypes.c_void_p())),
        lambda: dll.fmi2GetReal(component, (ctypes.c_uint * 1)(0), 1, (ctypes.c_double * 1)()),
        lambda: dll.fmi2Reset(None),
    ]
    if any(call() != ERROR for call in calls):
        raise WrongError("a call on a freed instance passes for good")
    dll.fmi2FreeInstance(component)
    dll.fmi2FreeInstance(None)


def batch(path: str, folder: str) -> tuple[int, int]:
    """Calls and steps done on two fresh instances. Raises WrongError."""
    sys.stderr.write("instantiate\n")
    pair = Caller(path, folder), Caller(path, folder)
    pair[0].other, pair[1].other = pair[1], pair[0]
    for _ in range(BATCH):
        place = random.randrange(2)
        caller, move = pair[place], random.choice(MOVES + USUAL)
        sys.stderr.write(f"{place} {move}\n")
        sys.stderr.flush()
        caller.messages.clear()
        status, allowed = getattr(caller, move)()
        if status not in allowed or (status != OK and not caller.messages):
            raise WrongError(f"{caller.phase}: status {status}, allowed {allowed}, log {caller.messages}")
    dll = pair[0].fmu.dll
    for caller in pair:
        caller.close()
    sys.stderr.write("free\n")
    call_dead(dll, pair[0].component)
    return BATCH, sum(caller.steps for caller in pair)


def main(path: str, seed: str, seconds: str) -> int:
    folder = fmpy.extract(path)
    random.seed(int(seed))
    calls, steps = 0, 0
    try:
        batch(path, folder)  # compiles, perhaps
        end = time.monotonic() + float(seconds)
        while time.monotonic() < end:
            more = batch(path, folder)
            calls, steps = calls + more[0], steps + more[1]
    except WrongError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(f"{calls} {steps}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
