"""Random calls of a native FMU's face, right and wrong: ``python face_fuzz.py library resources seconds seed``.

The unit is that of the FMU unpacked around `resources`, without a modelDescription.xml there the toy unit. Two instances live at a time,
freed and made anew at any moment. Prints the numbers of calls and of steps done; raises AssertionError where a call is answered with no
status of FMI, or with an error and without a word.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
import time
from ctypes import byref, c_void_p
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from toy_face import DISCARD, ERROR, GUID, OK, ROWS, Toy, library

NUMBERS = (0.0, 1.0, -1.0, 2.0, 7.5, 1e7, -math.inf, math.inf, math.nan, 1e308, 5e-324, 1e16)
STEPS = (0.01, 0.1, 1.0, 6.0, 1e-10, 1e4, *NUMBERS)
CALLS = 300  # on a pair of instances, at most


class Unit(NamedTuple):
    """What is known of a unit: its GUID, of each variable the kind and the name, and start values of those that can be set."""

    guid: str
    kinds: list[str]
    names: list[str]
    starts: dict[int, float]

    @classmethod
    def toy(cls) -> Unit:
        starts = {place: 1.0 for place, row in enumerate(ROWS) if row.causality != "output"}
        return cls(GUID, [row.kind for row in ROWS], [row.name for row in ROWS], starts)

    @classmethod
    def described(cls, folder: Path) -> Unit:
        """That of an unpacked FMU."""
        model = ElementTree.parse(folder / "modelDescription.xml").getroot()
        variables = list(model.iter("ScalarVariable"))
        assert [int(v.get("valueReference", "")) for v in variables] == list(range(len(variables)))
        starts = {}
        for place, variable in enumerate(variables):
            if variable.get("causality") != "output" and variable[0].tag != "String":
                text = variable[0].get("start", "0")
                starts[place] = float({"true": "1", "false": "0"}.get(text, text))
        kinds = ["Integer" if v[0].tag == "Enumeration" else v[0].tag for v in variables]
        return cls(model.get("guid", ""), kinds, [v.get("name", "") for v in variables], starts)


class Fuzzed(Toy):
    """An instance whose answers are looked at."""

    done = 0  # calls

    def call(self, name: str, *arguments: Any) -> int:
        """See Toy."""
        before = len(self.log)
        status = super().call(name, *arguments)
        self.done += 1
        assert status in (OK, DISCARD, ERROR), (name, status)
        assert status == OK or len(self.log) > before, (name, status)
        return status


def fuzz(lib: Any, resources: str, unit: Unit, seconds: float, seed: int) -> tuple[int, int]:
    """Number of random calls made in that time, and of steps done."""
    dice, calls, steps, end = random.Random(seed), 0, 0, time.monotonic() + seconds
    while time.monotonic() < end:
        it, other = Fuzzed(lib, resources, unit.guid), Fuzzed(lib, resources, unit.guid)
        states, now = [c_void_p(), c_void_p(3)], 0.0
        if dice.random() < 0.5:
            it.call("EnterInitializationMode")
            it.call("ExitInitializationMode")
        for _ in range(dice.randrange(CALLS)):
            one(dice, unit, it, other, states, now)
            if dice.random() < 0.3 and it.step(now, 0.1) == OK:
                now, steps = now + 0.1, steps + 1
        spoiled(dice, lib, resources, unit)
        calls += it.done + other.done
        it.free()
        other.free()
    return calls, steps


def one(dice: random.Random, unit: Unit, it: Fuzzed, other: Fuzzed, states: list[c_void_p], now: float) -> None:
    """One call, right or wrong."""
    state = dice.choice(states)
    match dice.randrange(15):
        case 0:
            it.call("SetupExperiment", 0, 0.0, dice.choice((now, *NUMBERS)), dice.randrange(2), dice.choice(NUMBERS))
        case 1 | 2:
            it.call(dice.choice(("EnterInitializationMode", "ExitInitializationMode", "ExitInitializationMode")))
        case 3:
            if dice.random() < 0.3:
                it.call(dice.choice(("Reset", "EnterEventMode", "CancelStep", "Terminate")))
        case 4 | 5:
            kind, references = drawn(dice, unit, range(len(unit.kinds)))
            it.get(kind, *references)
        case 6:
            kind, references = drawn(dice, unit, range(len(unit.kinds)))
            it.set(kind, *((reference, wild(dice, kind)) for reference in references))
        case 7 | 8:
            kind, references = drawn(dice, unit, list(unit.starts))
            it.set(kind, *((reference, near(dice, unit, kind, reference)) for reference in references))
        case 9:
            it.step(dice.choice((now, now, *NUMBERS)), dice.choice(STEPS))
        case 10:
            states.append(it.state(c_void_p(state.value) if dice.random() < 0.3 else None))
        case 11 | 12:
            dice.choice((it, it, other)).call("SetFMUstate", state)
        case 13:
            it.call("FreeFMUstate", byref(c_void_p(state.value)))
        case 14:
            saved = it.state()
            data = bytearray(it.bytes_of(saved))
            if dice.random() < 0.5:
                data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
            status, read = other.read(bytes(data[: dice.choice((len(data), len(data), dice.randrange(len(data))))]))
            if status == OK:
                other.call("SetFMUstate", read)
                other.step(now, 0.1)


def spoiled(dice: random.Random, lib: Any, resources: str, unit: Unit) -> None:
    """An instance of damaged data: there is none, and a word why."""
    data = bytearray(Path(resources, "unit.bin").read_bytes())
    data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "unit.bin").write_bytes(data[: dice.choice((len(data), dice.randrange(1, len(data))))])
        it = Toy(lib, folder, unit.guid)
    assert not it.handle
    assert len(it.log) == 1


def drawn(dice: random.Random, unit: Unit, among: Any) -> tuple[str, list[int]]:
    """A kind and value references, most of them of that kind, some of no variable."""
    kind = unit.kinds[dice.choice(among)]
    right = [reference for reference in among if unit.kinds[reference] == kind]
    wrong = [*among, len(unit.kinds), 2**31, 2**32 - 1]
    return kind, [dice.choice(wrong if dice.random() < 0.03 else right) for _ in range(dice.randrange(5))]


def wild(dice: random.Random, kind: str) -> Any:
    """Any value of a kind."""
    match kind:
        case "Real":
            return dice.choice(NUMBERS)
        case "String":
            return dice.choice(("", "x", "50 % Öl", "%s%n" * 99))
    return dice.choice((0, 1, 2, 5, -1, 2**31 - 1, -(2**31)))


def near(dice: random.Random, unit: Unit, kind: str, reference: int) -> Any:
    """Mostly a value close to the one at the start, so that units start with it."""
    if kind == "String" or dice.random() < 0.1:
        return wild(dice, kind)
    start = unit.starts.get(reference, 0.0)
    return start * dice.uniform(0.95, 1.05) + dice.choice((0.0, 0.01)) if kind == "Real" else int(start)


if __name__ == "__main__":
    path, place, time_given, seed_given = sys.argv[1:]
    around = Path(place).parent
    known = Unit.described(around) if (around / "modelDescription.xml").exists() else Unit.toy()
    print(*fuzz(library(Path(path)), place, known, float(time_given), int(seed_given)))
