"""Random calls of a native FMU's face: ``python face_fuzz.py library resources seconds``. Prints the number of calls."""

import math
import random
import sys
import time
from ctypes import byref, c_void_p

from toy_face import ROWS, Toy, library

NUMBERS = (0.0, 1.0, -1.0, 2.0, 7.5, 1e7, -math.inf, math.inf, math.nan, 1e308, 5e-324, 1e16)


def fuzz(lib, resources, seconds, seed):
    """Number of random calls made in that time."""
    dice, calls, end = random.Random(seed), 0, time.monotonic() + seconds
    while time.monotonic() < end:
        it, other = Toy(lib, resources), Toy(lib, resources)
        states, now = [c_void_p(), c_void_p(3)], 0.0
        for _ in range(300):
            calls += 1
            one(dice, it, other, states, now)
            now = it.real(0) if dice.random() < 0.01 else now
            if dice.random() < 0.3 and it.step(now, 0.1) == 0:
                now += 0.1
        it.free()
        other.free()
    return calls


def one(dice, it, other, states, now):
    """One call, right or wrong."""
    kind, n = dice.choice(("Real", "Integer", "Boolean", "String")), dice.randrange(4)
    references = [
        dice.choice((dice.randrange(len(ROWS)), 2**32 - 1)) if dice.random() < 0.1 else dice.randrange(len(ROWS)) for _ in range(n)
    ]
    whole = [dice.choice((0, 1, 2, 5, -1, 2**31 - 1, -(2**31))) for _ in references]
    values = {"Real": dice.choices(NUMBERS, k=n), "String": dice.choices(("", "x", "50 % Öl", "%s%n" * 99), k=n)}.get(kind, whole)
    state = dice.choice(states)
    match dice.randrange(14):
        case 0:
            it.call("SetupExperiment", 0, 0.0, dice.choice(NUMBERS), dice.randrange(2), dice.choice(NUMBERS))
        case 1 | 2:
            it.call(dice.choice(("EnterInitializationMode", "ExitInitializationMode", "Terminate")))
        case 3:
            it.call(dice.choice(("Reset", "EnterEventMode", "CancelStep"))) if dice.random() < 0.3 else None
        case 4 | 5:
            it.get(kind, *references)
        case 6 | 7:
            it.set(kind, *zip(references, values, strict=True))
        case 8:
            it.step(dice.choice((now, *NUMBERS)), dice.choice((6.0, *NUMBERS)))
        case 9:
            states.append(it.state(c_void_p(state.value) if dice.random() < 0.3 else None))
        case 10 | 11:
            it.call("SetFMUstate", state)
        case 12:
            it.call("FreeFMUstate", byref(c_void_p(state.value)))
        case 13:
            saved = it.state()
            data = bytearray(it.bytes_of(saved))
            if dice.random() < 0.5:
                data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
            status, read = other.read(bytes(data[: dice.choice((len(data), len(data), dice.randrange(len(data))))]))
            if status == 0:
                other.call("SetFMUstate", read)


if __name__ == "__main__":
    print(fuzz(library(sys.argv[1]), sys.argv[2], float(sys.argv[3]), 1), "calls")
