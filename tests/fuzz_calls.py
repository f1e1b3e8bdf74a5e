"""Random FMI calls, right and wrong, on one FMU; run as a program: ``fuzz_calls.py FMU SEED SECONDS``.

The calls go to a journal on the error stream before they are made, so that a crash leaves them behind. Ends with exit code 1 where a wrong
call is answered with fmi2OK, or an error has no message.
"""

from __future__ import annotations

import ctypes
import random
import sys
import time

import fmpy
from fmpy import fmi2

GOOD, BAD = (0, 1), (2, 3, 4)
BATCH = 60  # calls on one instance


class Caller:
    """One instance and what may be asked of it."""

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
        self.time, self.phase = 0.0, "instantiated"
        self.states: list[ctypes.c_void_p] = []

    def call(self, name: str, *arguments: object) -> int:
        return int(self.fmu.dll[f"fmi2{name}"](self.component, *arguments))

    def reals(self, name: str, reference: int, value: float = 0.0) -> int:
        return self.call(name, (ctypes.c_uint * 1)(reference), 1, (ctypes.c_double * 1)(value))

    def of(self, causality: str) -> int:
        return int(random.choice([v.valueReference for v in self.variables if v.causality == causality and v.type == "Real"]))

    # each answers (status, statuses allowed)

    def initialize(self) -> tuple[int, tuple[int, ...]]:
        if self.phase != "instantiated":
            return 0, GOOD
        done = self.call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(0.0), 0, ctypes.c_double(0.0))
        done = max(done, self.call("EnterInitializationMode"), self.call("ExitInitializationMode"))
        self.phase, self.time = "stepping", 0.0
        return done, GOOD

    def step(self) -> tuple[int, tuple[int, ...]]:
        status = self.call("DoStep", ctypes.c_double(self.time), ctypes.c_double(0.1), 0)
        if self.phase != "stepping":
            return status, BAD
        self.time += 0.1
        return status, GOOD

    def step_badly(self) -> tuple[int, tuple[int, ...]]:
        length, start = random.choice([(-0.1, self.time), (0.0, self.time), (float("nan"), self.time), (0.1, self.time + 3.0)])
        return self.call("DoStep", ctypes.c_double(start), ctypes.c_double(length), 0), BAD

    def step_with_nan(self) -> tuple[int, tuple[int, ...]]:
        reference = self.of("input")
        self.reals("SetReal", reference, random.choice([float("nan"), float("inf")]))
        status = self.call("DoStep", ctypes.c_double(self.time), ctypes.c_double(0.1), 0)
        self.reals("SetReal", reference, 0.0)
        return status, BAD

    def push(self) -> tuple[int, tuple[int, ...]]:
        return self.reals("SetReal", self.of("input"), random.uniform(-1.0, 1.0)), GOOD

    def read(self) -> tuple[int, tuple[int, ...]]:
        return self.reals("GetReal", self.of("output")), GOOD if self.phase == "stepping" else BAD

    def read_unknown(self) -> tuple[int, tuple[int, ...]]:
        return self.reals("GetReal", random.choice([10**6, 2**31 - 1])), BAD

    def set_output(self) -> tuple[int, tuple[int, ...]]:
        return self.reals("SetReal", self.of("output"), 1.0), BAD

    def set_long_text(self) -> tuple[int, tuple[int, ...]]:
        reference = next(v.valueReference for v in self.variables if v.name == "configuration")
        text = (ctypes.c_char_p * 1)(b"%s{" * 50000)
        status = self.call("SetString", (ctypes.c_uint * 1)(reference), 1, text)
        if self.phase == "instantiated":  # refused when it is read
            self.call("SetString", (ctypes.c_uint * 1)(reference), 1, (ctypes.c_char_p * 1)(b""))
            return status, (*GOOD, *BAD)
        return status, BAD

    def save(self) -> tuple[int, tuple[int, ...]]:
        if self.phase != "stepping":
            return 0, GOOD
        state = ctypes.c_void_p()
        status = self.call("GetFMUstate", ctypes.byref(state))
        self.states.append(state)
        return status, GOOD

    def restore(self) -> tuple[int, tuple[int, ...]]:
        if not self.states:
            return 0, GOOD
        status = self.call("SetFMUstate", random.choice(self.states))
        time_of = self._time()
        self.time = time_of
        return status, GOOD

    def _time(self) -> float:
        """The time of the restored state, found by asking for a step from far away: the refusal names it."""
        self.messages.clear()
        self.call("DoStep", ctypes.c_double(-1e6), ctypes.c_double(0.1), 0)
        words = b" ".join(self.messages).decode()
        return float(words.partition("stands at ")[2].split()[0])

    def free(self) -> tuple[int, tuple[int, ...]]:
        if not self.states:
            return 0, GOOD
        state = self.states.pop(random.randrange(len(self.states)))
        return self.call("FreeFMUstate", ctypes.byref(state)), GOOD

    def reset(self) -> tuple[int, tuple[int, ...]]:
        while self.states:
            self.free()
        self.phase, self.time = "instantiated", 0.0
        return self.call("Reset"), GOOD

    def close(self) -> None:
        while self.states:
            self.free()
        self.fmu.freeInstance()


MOVES = [name for name in vars(Caller) if not name.startswith("_") and name not in ("call", "reals", "of", "close")]


def main(path: str, seed: str, seconds: str) -> int:
    folder = fmpy.extract(path)
    random.seed(int(seed))
    end, count = time.monotonic() + float(seconds), 0
    while time.monotonic() < end:
        caller = Caller(path, folder)
        sys.stderr.write("instantiate\n")
        for _ in range(BATCH):
            move = random.choice(MOVES)
            sys.stderr.write(f"{move}\n")
            sys.stderr.flush()
            caller.messages.clear()
            status, allowed = getattr(caller, move)()
            count += 1
            if status not in allowed or (status > 1 and not caller.messages):
                sys.stderr.write(f"status {status}, allowed {allowed}, log {caller.messages}\n")
                return 1
        caller.close()
        sys.stderr.write("free\n")
    sys.stdout.write(f"{count}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
