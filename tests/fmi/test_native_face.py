"""The C face of native FMUs (master/fmi/native), call by call, on a toy unit: a mass on a spring under the implicit midpoint rule."""

import ctypes
import math
import os
import random
import struct
import subprocess
import sys
import threading
import time
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path

import numpy as np
import pytest
from toy_face import (
    CALLS,
    DISCARD,
    ENERGY,
    ERROR,
    FORCE,
    GUID,
    KERNELS,
    KIND,
    LABEL,
    LINUX,
    MASS,
    MASS_OF,
    MOST,
    OK,
    PINNED,
    POSITION,
    ROWS,
    SILENT,
    SPARE,
    START,
    STEPS,
    STIFFNESS,
    STIFFNESS_OF,
    UNUSED,
    VELOCITY,
    WARNING,
    Toy,
    compiled,
    library,
    toy_file,
)  # fmt: skip

from master.fmi.native.tables import Row, checksum, unit_file

MACH = b"\xcf\xfa\xed\xfe"
TARGETS = {"x86_64-windows-gnu": b"MZ", "x86_64-macos": MACH, "aarch64-macos": MACH, "aarch64-linux-gnu.2.17": b"\x7fELF"}


@pytest.fixture(scope="module")
def lib():
    return library()


@pytest.fixture(scope="module")
def resources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("toy")
    (folder / "unit.bin").write_bytes(toy_file())
    return str(folder)


@pytest.fixture
def toy(lib, resources):
    it = Toy(lib, resources)
    assert it.handle, it.log
    yield it
    it.free()


def after(steps, h=0.1, force=3.0, mass=MASS_OF, stiffness=STIFFNESS_OF, start=START):
    """Position and velocity by the midpoint rule, solved as a system of two equations."""
    a = np.array([[0.0, 1.0], [-stiffness / mass, 0.0]])
    state = np.array(start)
    for _ in range(steps):
        state = np.linalg.solve(np.eye(2) - 0.5 * h * a, (np.eye(2) + 0.5 * h * a) @ state + h * np.array([0.0, force / mass]))
    return state


# instances


def test_says_what_it_is(lib):
    assert (lib.fmi2GetVersion(), lib.fmi2GetTypesPlatform()) == (b"2.0", b"default")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": 0}, "only co-simulation is offered"),
        ({"location": None}, "no resource location was given"),
        ({"guid": "{other}"}, "GUID = {other}: must be {toy}, as in modelDescription.xml"),
        ({"guid": None}, "GUID = : must be {toy}, as in modelDescription.xml"),
        ({"location": "file:///nowhere%20at%25all"}, "resources: /nowhere at%%all/unit.bin: No such file or directory"),
    ],
)
def test_refuses_to_be_made(lib, resources, change, words):
    it = Toy(lib, **{"location": resources, "guid": GUID, **change})
    assert not it.handle
    assert it.log == [(ERROR, "logStatusError", words)]
    assert not Toy(lib, **{"location": resources, "guid": GUID, **change}, mute=True).handle
    assert not lib.fmi2Instantiate(None, 0, None, None, None, 0, 0)


HEAD = 32  # bytes of unit.bin before what its checksum is of
OTHER = "of another version or unit than the library; take both from one FMU"


def filed(content, kernels=KERNELS):
    """unit.bin with this content."""
    return toy_file()[:16] + struct.pack("<QQ", kernels, checksum(content)) + content


def test_refuses_the_data_of_another_library(lib, tmp_path):
    for kernels in (0, KERNELS - 1, KERNELS ^ 1 << 63):
        (tmp_path / "unit.bin").write_bytes(filed(toy_file()[HEAD:], kernels))
        it = Toy(lib, str(tmp_path))
        assert not it.handle
        assert it.log == [(ERROR, "logStatusError", f"resources: {tmp_path}/unit.bin: {OTHER}")]


def test_refuses_other_data(lib, tmp_path):
    whole, lost = toy_file(), "not the data of a unit, or not all of them"
    content, dice = whole[HEAD:], random.Random(2)
    damaged = [whole[:place] + bytes([whole[place] ^ 1 << dice.randrange(8)]) + whole[place + 1 :] for place in range(0, len(whole), 7)]
    for data in (
        whole[:-8], whole[:60], whole + b"\0" * 8, b"x" * 4000, *damaged,
        filed(struct.pack("<q", -1) + content[8:]), filed(struct.pack("<q", 2**62) + content[8:]), filed(content[:-1] + b"x"),
    ):  # fmt: skip
        (tmp_path / "unit.bin").write_bytes(data)
        it = Toy(lib, str(tmp_path))
        assert not it.handle
        of_another = data[:16] == whole[:16] and data[16:24] != whole[16:24]
        assert it.log == [(ERROR, "logStatusError", f"resources: {tmp_path}/unit.bin: {OTHER if of_another else lost}")]


def test_damaged_tables_crash_nothing(lib, tmp_path):
    whole, dice = toy_file(), random.Random(1)
    for _ in range(2000):
        content = bytearray(whole[HEAD:])
        place = 88 + 8 * dice.randrange((len(content) - 88) // 8)
        content[place : place + 8] = struct.pack("<q", dice.choice((-1, 1, 2**31, 2**63 - 1, dice.randrange(2**40))))
        (tmp_path / "unit.bin").write_bytes(filed(content))
        it = Toy(lib, str(tmp_path))
        if it.handle:
            for kind in ("Real", "Integer", "Boolean", "String"):
                for reference in range(len(ROWS)):
                    it.get(kind, reference)
            it.free()


def test_finds_its_resources_by_every_form_of_location(lib, tmp_path):
    folder = tmp_path / "a b%41 Ö#"
    folder.mkdir()
    (folder / "unit.bin").write_bytes(toy_file())
    plain, quoted = str(folder), str(folder).replace("%", "%25").replace(" ", "%20").replace("Ö", "%c3%96")
    for location in (plain, plain + "/", "file://" + quoted, f"file://{quoted}//", "file:" + quoted, "file://localhost" + quoted):
        it = Toy(lib, location)
        assert it.handle, (location, it.log)
        it.free()


def test_nothing_is_no_instance(lib):
    handle = c_void_p()
    for name in ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset", "CancelStep", "EnterEventMode"):
        assert getattr(lib, f"fmi2{name}")(None) == ERROR
    assert lib.fmi2DoStep(None, 0.0, 1.0, 0) == ERROR
    assert lib.fmi2GetReal(None, None, 0, None) == ERROR
    assert lib.fmi2SetString(None, None, 0, None) == ERROR
    assert lib.fmi2GetFMUstate(None, byref(handle)) == ERROR
    assert lib.fmi2FreeFMUstate(None, byref(handle)) == ERROR
    lib.fmi2FreeInstance(None)


def test_10000_instances_leave_no_memory(lib, resources):
    def cycle(n):
        for _ in range(n):
            it = Toy(lib, resources, mute=True).ready()
            it.step(0.0, 0.1)
            it.state()  # freed with the instance
            it.call("FreeFMUstate", byref(it.state()))
            it.free()
        it = Toy(lib, resources, mute=True)
        for _ in range(20 * n):
            it.call("FreeFMUstate", byref(it.state()))
        it.free()
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

    before = cycle(500)
    assert cycle(10_000) - before < 1000  # kB; an instance alone has 4


# phases


def test_phases(toy):
    assert toy.call("ExitInitializationMode") == ERROR
    assert toy.said == "end of initialisation mode: the FMU is not initialised"
    assert toy.call("Terminate") == ERROR
    assert toy.said == "terminate: the FMU is not initialised"
    assert toy.step(0.0, 0.1) == DISCARD
    assert toy.log.pop() == (DISCARD, "logStatusDiscard", "step at 0 s: the FMU is not initialised")
    assert toy.get("Real", POSITION) == ERROR
    assert toy.said == "outputs: not defined before initialisation"
    assert toy.get("Real", FORCE, MASS) == [3.0, 2.0]
    toy.ready()
    for call, words in (("SetupExperiment", "set-up of the experiment"), ("EnterInitializationMode", "initialisation mode")):
        assert toy.call(call, *((0, 0.0, 0.0, 0, 0.0) if call == "SetupExperiment" else ())) == ERROR
        assert toy.said == f"{words}: the FMU is initialised"
    assert toy.step(0.0, 0.1) == OK
    assert toy.call("Terminate") == OK
    assert toy.step(0.1, 0.1) == DISCARD
    assert toy.said == "step at 0.1 s: the FMU is terminated"
    assert toy.get("Real", STEPS) == [1.0]
    assert toy.set("Real", (FORCE, 1.0)) == ERROR
    assert toy.said == "force = 1.0: the FMU is terminated"
    assert toy.call("Reset") == OK
    assert toy.ready().get("Real", STEPS, POSITION) == [0.0, START[0]]
    assert toy.log == []


def test_set_up(toy):
    assert toy.call("SetupExperiment", 0, 0.0, math.nan, 0, 0.0) == ERROR
    assert toy.said == "start time = nan: must be finite"
    assert toy.call("SetupExperiment", 0, 0.0, 2.0, 1, 1.0) == ERROR
    assert toy.said == "stop time = 1.0: must be >= the start time, 2.0 s"
    assert toy.call("SetupExperiment", 0, 0.0, 2.0, 0, 1.0) == OK


def test_outputs_are_made_on_demand_and_anew_after_a_set(toy):
    toy.call("EnterInitializationMode")
    assert toy.real(POSITION) == START[0]
    assert toy.set("Integer", (KIND, 2)) == OK
    assert toy.real(POSITION) == START[0] + 0.5
    assert toy.set("Real", (STIFFNESS, 4.0)) == OK
    assert toy.real(ENERGY) == pytest.approx(0.5 * (MASS_OF * 1.0 + 4.0 * 0.75**2), rel=1e-15)
    assert toy.call("ExitInitializationMode") == OK


def test_outputs_are_computed_once_a_state_and_only_where_asked_for(toy):
    toy.ready()
    assert toy.get("Real", POSITION, VELOCITY) == list(START)
    assert toy.get("Real", CALLS, ENERGY, CALLS) == [1.0, 0.5 * (MASS_OF + STIFFNESS_OF * START[0] ** 2), 1.0]
    toy.step(0.0, 0.1)
    toy.step(0.1, 0.1)
    assert toy.real(CALLS) == 2.0


def test_a_failed_initialisation_can_be_tried_again(toy):
    toy.call("EnterInitializationMode")
    for pair, words in (
        ((MASS, 0.0), "mass = 0: must be > 0 kg"),
        ((STIFFNESS, -1.5), "stiffness = -1.5: must be >= 0 N/m"),
        ((STIFFNESS, 2.5e6), "stiffness = 2.5e+06: breaks the spring"),
        ((FORCE, math.inf), "force = inf: must be finite"),
        ((FORCE, 2e6), "start refused"),
    ):
        assert toy.set("Real", pair) == OK
        assert toy.call("ExitInitializationMode") == ERROR
        assert toy.log == [(ERROR, "logStatusError", words)]
        assert toy.step(0.0, 0.1) == DISCARD
        assert toy.said == "step at 0 s: the FMU is not initialised"
        toy.log.clear()
        assert toy.set("Real", (MASS, MASS_OF), (STIFFNESS, 0.0), (FORCE, 1.0)) == OK
        toy.call("EnterInitializationMode")
    assert toy.set("Integer", (MOST, 10)) == OK
    assert toy.get("Real", POSITION) == ERROR
    assert toy.said == "most = 10: must be 1 to 9"
    assert toy.set("Integer", (MOST, 9)) == OK
    assert toy.call("ExitInitializationMode") == OK
    assert toy.step(0.0, 0.1) == OK
    assert toy.get("Real", POSITION, VELOCITY) == pytest.approx(after(1, force=1.0, stiffness=0.0), rel=1e-14)


def test_a_warning_of_the_start_is_told_once_at_its_end(toy):
    toy.set("Real", (FORCE, 5000.0))
    toy.call("EnterInitializationMode")
    assert toy.real(POSITION) == START[0]
    assert toy.log == []
    assert toy.call("ExitInitializationMode") == OK
    assert toy.log == [(WARNING, "logStatusWarning", "start pulled by 5000 N")]


# steps


def test_steps_as_the_midpoint_rule(toy):
    toy.ready(start=5.0)
    for i in range(20):
        assert toy.step(5.0 + 0.1 * i, 0.1) == OK
    assert toy.get("Real", POSITION, VELOCITY) == pytest.approx(after(20), rel=1e-13)
    assert toy.get("Integer", STEPS) == [20]
    last = c_double()
    assert toy.call("GetRealStatus", 2, byref(last)) == OK
    assert last.value == pytest.approx(7.0, abs=1e-14)
    assert toy.call("GetRealStatus", 1, byref(last)) == DISCARD


@pytest.mark.parametrize(
    ("time", "step", "status", "words"),
    [
        (0.0, 0.0, ERROR, "step of 0.0 s at 0.0 s: must be finite, and the step > 0 s"),
        (0.0, -0.1, ERROR, "step of -0.1 s at 0.0 s: must be finite, and the step > 0 s"),
        (math.nan, 0.1, ERROR, "step of 0.1 s at nan s: must be finite, and the step > 0 s"),
        (0.0, math.inf, ERROR, "step of inf s at 0.0 s: must be finite, and the step > 0 s"),
        (0.1 + 0.2, 0.1, DISCARD, "time = 0.30000000000000004: the FMU stands at 0.0 s"),
        (1e-6, 0.1, DISCARD, "time = 1e-06: the FMU stands at 0.0 s"),
        (0.0, 21.0, ERROR, "step to 21.0 s: the stop time is 20.0 s"),
        (0.0, 11.5, DISCARD, "step of 11.5 s at t = 0 s: too long"),
        (0.0, 9.0, DISCARD, "step: the unit refuses it"),
    ],
)
def test_refuses_a_step_and_stands_where_it_stood(toy, time, step, status, words):
    toy.ready(stop=20.0)
    assert toy.step(time, step) == status
    assert toy.log == [(status, {DISCARD: "logStatusDiscard", ERROR: "logStatusError"}[status], words)]
    assert toy.get("Real", POSITION, VELOCITY, STEPS) == [*START, 0.0]
    assert toy.step(5e-8, 0.1) == OK  # hosts add up their time in ways of their own


def test_a_late_time_may_be_off_by_its_round_off(toy):
    toy.ready(start=1e6)
    assert toy.step(1e6 + 2e-6, 1e-5) == DISCARD
    assert toy.step(1e6 + 5e-7, 1e-5) == OK


def test_an_input_that_is_not_finite_discards_the_step(toy):
    toy.ready()
    assert toy.set("Real", (FORCE, 1.0), (SPARE, -math.inf)) == OK
    assert toy.step(0.0, 0.1) == DISCARD
    assert toy.said == "spare[1] = -inf: must be finite"
    toy.set("Real", (SPARE, 1e308))
    assert toy.step(0.0, 0.1) == OK


def test_notes_of_a_step_that_was_done(toy):
    toy.ready()
    assert toy.step(0.0, 6.0) == OK
    assert toy.log == [(WARNING, "logStatusWarning", "100 %% of step after +6.00e+00 s"), (WARNING, "logStatusWarning", "only a remark")]


def test_a_message_is_one_line_of_at_most_1000_characters(lib, tmp_path):
    rows = [*ROWS[:-1], Row("label\n\t\u00e4" + "\u00e4%" * 900, "parameter", "String", text="x")]
    (tmp_path / "unit.bin").write_bytes(toy_file(rows))
    it = Toy(lib, str(tmp_path))
    it.set("String", (LABEL, "y"))
    text = it.said
    assert text == "label \u00e4" + "\u00e4%%" * 496 + "\u00e4"
    assert len(text % ()) == 1000
    it.free()
    strange = Toy(lib, str(tmp_path), guid="a\x01\x7f  b")
    assert strange.said == "GUID = a?? b: must be {toy}, as in modelDescription.xml"


# variables


def test_sets_all_or_none(toy):
    for pairs, words in (
        ([(FORCE, 9.0), (POSITION, 1.0)], "position = 1.0: an output cannot be set"),
        ([(MASS, 9.0), (STEPS, 1.0)], "steps = 1.0: an output cannot be set"),
        ([(FORCE, 9.0), (99, 1.0)], "value reference = 99: must be below 15"),
        ([(FORCE, 9.0), (KIND, 1.0)], "kind: asked for as Real, is Enumeration"),
        ([(FORCE, 9.0), (LABEL, 1.0)], "label: asked for as Real, is String"),
        ([(FORCE, 9.0), (MASS, math.nan)], "mass = nan: must be finite"),
        ([(FORCE, 9.0), (PINNED, 0.25)], "pinned = 0.25: is fixed at export; export the FMU anew with it"),
    ):
        assert toy.set("Real", *pairs) == ERROR
        assert toy.said == words
        assert toy.get("Real", FORCE, MASS) == [3.0, 2.0]
    toy.ready()
    assert toy.set("Real", (FORCE, 9.0), (UNUSED, 1.0)) == ERROR
    assert toy.said == "unused = 1.0: a parameter cannot be set after initialisation"
    assert toy.get("Real", FORCE) == [3.0]


def test_kinds(toy):
    assert toy.set("Boolean", (SILENT, 7)) == OK
    assert toy.get("Boolean", SILENT) == [1]
    for value, shown in ((0, "0"), (3, "3"), (-(2**31), "-2147483648")):
        assert toy.set("Integer", (MOST, 4), (KIND, value)) == ERROR
        assert toy.said == f"kind = {shown}: must be one of 1 (linear), 2 (shifted)"
    assert toy.get("Integer", KIND, MOST) == [1, 5]
    assert toy.get("Boolean", FORCE) == ERROR
    assert toy.said == "force: asked for as Boolean, is Real"
    assert toy.set("Boolean", (STEPS, 1)) == ERROR
    assert toy.said == "steps: asked for as Boolean, is Integer"
    assert toy.get("Real", FORCE, MOST) == ERROR
    assert toy.said == "most: asked for as Real, is Integer"
    toy.ready()
    assert toy.set("Boolean", (SILENT, 0)) == ERROR
    assert toy.said == "silent = False: a parameter cannot be set after initialisation"


def test_texts(toy):
    assert toy.get("String", LABEL) == ["50 % Öl".encode()]
    assert toy.set("String", (LABEL, "50 % Öl")) == OK
    assert toy.set("String", (LABEL, "60 %")) == ERROR
    assert toy.said == "label = '60 %%': is fixed at export; export the FMU anew with it"
    assert toy.set("String", (LABEL, "Ö" * 100)) == ERROR
    assert toy.said.startswith("label = 'ÖÖ")
    assert toy.call("SetString", (c_uint * 1)(LABEL), 1, (c_char_p * 1)(None)) == ERROR
    assert toy.call("SetString", None, 1, None) == ERROR
    assert toy.said == "set: no array was given"
    assert toy.call("GetReal", (c_uint * 1)(0), 1, None) == ERROR
    assert toy.said == "get: no array was given"
    assert toy.call("GetReal", None, 0, None) == OK


def test_the_rest_is_not_offered(toy):
    assert toy.call("CancelStep") == ERROR
    assert toy.said == "cancelling a step: not offered"
    assert toy.call("EnterEventMode") == ERROR
    assert toy.said == "model exchange: not offered"
    value = c_int(5)
    assert toy.call("GetStatus", 0, byref(value)) == DISCARD
    assert toy.call("GetBooleanStatus", 3, byref(value)) == OK
    assert value.value == 0


# states


def test_goes_back_to_a_state(toy):
    toy.ready()
    toy.step(0.0, 0.1)
    state, seen = toy.state(), toy.get("Real", POSITION, VELOCITY, ENERGY)
    toy.set("Real", (FORCE, 50.0))
    first = [toy.step(0.1 + 0.1 * i, 0.1) for i in range(5)], toy.get("Real", POSITION, VELOCITY, ENERGY)
    for _ in range(2):
        assert toy.call("SetFMUstate", state) == OK
        assert toy.get("Real", POSITION, VELOCITY, ENERGY, FORCE) == [*seen, 3.0]
        toy.set("Real", (FORCE, 50.0))
        again = [toy.step(0.1 + 0.1 * i, 0.1) for i in range(5)], toy.get("Real", POSITION, VELOCITY, ENERGY)
        assert again == first
    same = toy.state(c_void_p(state.value))
    assert same.value == state.value
    assert toy.call("SetFMUstate", state) == OK
    assert toy.get("Real", POSITION, VELOCITY, ENERGY) == first[1]


def test_a_state_brings_its_parameters_and_its_phase(toy):
    toy.set("Real", (STIFFNESS, 4.0))
    early = toy.state()
    toy.ready()
    toy.step(0.0, 0.1)
    soft, seen = toy.state(), toy.get("Real", POSITION, ENERGY)
    toy.call("Reset")
    toy.ready()
    toy.step(0.0, 0.1)
    assert toy.get("Real", POSITION, ENERGY) != seen
    assert toy.call("SetFMUstate", soft) == OK
    assert toy.get("Real", POSITION, ENERGY, STIFFNESS) == [*seen, 4.0]
    toy.step(0.1, 0.1)
    assert toy.get("Real", POSITION) == pytest.approx([after(2, stiffness=4.0)[0]], rel=1e-14)
    assert toy.call("SetFMUstate", early) == OK
    assert toy.get("Real", POSITION) == ERROR
    assert toy.get("Real", STIFFNESS) == [4.0]
    toy.ready()
    assert toy.get("Real", POSITION) == [START[0]]


def test_a_wrong_state_is_found_out(toy, lib, resources):
    other = Toy(lib, resources).ready()
    foreign, state, gone = other.state(), toy.state(), toy.state()
    freed = c_void_p(gone.value)
    assert toy.call("FreeFMUstate", byref(gone)) == OK
    assert gone.value is None
    assert toy.call("FreeFMUstate", byref(gone)) == OK
    for wrong in (freed, foreign, c_void_p(None), c_void_p(1), c_void_p(12345678)):
        rest = {"SetFMUstate": (), "SerializedFMUstateSize": (byref(c_size_t()),), "SerializeFMUstate": (ctypes.create_string_buffer(9), 9)}
        for call, arguments in rest.items():
            assert toy.call(call, wrong, *arguments) == ERROR
            assert toy.said == "state: unknown, or freed before"
    assert toy.call("FreeFMUstate", byref(freed)) == ERROR
    assert toy.call("FreeFMUstate", None) == OK
    assert toy.call("SetFMUstate", state) == OK
    assert toy.call("GetFMUstate", None) == ERROR
    other.free()


def test_bytes_of_a_state_go_to_another_instance(toy, lib, resources):
    toy.set("Real", (MASS, 3.0))
    bare = toy.bytes_of(toy.state())
    toy.ready(start=1.0)
    toy.step(1.0, 0.1)
    data = toy.bytes_of(toy.state())
    other = Toy(lib, resources)
    status, state = other.read(data)
    assert status == OK
    assert other.bytes_of(state) == data
    assert other.call("SetFMUstate", state) == OK
    for it in (toy, other):
        it.step(1.1, 0.1)
    assert toy.get("Real", POSITION, VELOCITY, ENERGY, MASS) == other.get("Real", POSITION, VELOCITY, ENERGY, MASS)
    assert other.get("Real", POSITION) == pytest.approx([after(2, mass=3.0)[0]], rel=1e-14)
    status, state = other.read(bare)
    assert status == OK
    assert other.call("SetFMUstate", state) == OK
    assert other.get("Real", MASS) == [3.0]
    assert other.get("Real", POSITION) == ERROR
    other.free()


def signed(data, place, kind, value):
    """The bytes with a value changed, and the checksum of that."""
    changed = bytearray(data)
    struct.pack_into(kind, changed, place, value)
    struct.pack_into("<Q", changed, 24, checksum(changed[32:]))
    return bytes(changed)


def test_refuses_bytes_of_no_state(toy):
    toy.ready()
    data = toy.bytes_of(toy.state())
    lost = "state: cannot be read back: these {} bytes are not those of a state, or not all of them"
    for bad in (b"", data[:100], data[:-8], data + b"\0", b"x" * len(data)):
        status, handle = toy.read(bad)
        assert (status, handle.value) == (ERROR, None)
        assert toy.said == lost.format(len(bad))
    for place in range(len(data)):
        bad = bytearray(data)
        bad[place] ^= 0x10
        assert toy.read(bytes(bad))[0] == ERROR
    toy.log.clear()
    first = 144  # of the values
    for (place, kind, value), words in (
        ((32, "5s", b"{any}"), "state: of another FMU, with the GUID {any}"),
        ((96, "<q", 8), "state: of another layout: 8 parameters, 2 inputs, 3 values, must be 7, 2, 3"),
        ((120, "<q", 0), "state: cannot be read back: it is not initialised, with the state of a unit"),
        ((120, "<q", 7), "state: cannot be read back: its time is 0.0 s, its phase 7"),
        ((128, "<q", 0), "state: cannot be read back: it is initialised, without the state of a unit"),
        ((136, "<d", math.nan), "state: cannot be read back: its time is nan s, its phase 2"),
        ((first, "<d", math.inf), "mass = inf: must be finite"),
        ((first + 24, "<d", 1.5), "kind = 1.5: must be one of 1 (linear), 2 (shifted)"),
        ((first + 48, "<d", 0.2), "pinned = 0.2: is fixed at export; export the FMU anew with it"),
    ):
        assert toy.read(signed(data, place, kind, value))[0] == ERROR
        assert toy.said == words
    assert toy.read(signed(data, len(data) - 8, "<d", math.nan))[0] == OK
    status, state = toy.read(signed(data, first, "<d", -1.0))
    assert status == OK
    assert toy.call("SetFMUstate", state) == ERROR
    assert toy.said == "mass = -1: must be > 0 kg"
    assert toy.get("Real", MASS, POSITION) == [MASS_OF, START[0]]


# threads and time


def trajectory(lib, resources, seed):
    dice, it, seen = random.Random(seed), Toy(lib, resources, mute=True), []
    it.set("Real", (STIFFNESS, 1.0 + seed))
    it.ready()
    for i in range(500):
        it.set("Real", (FORCE, dice.uniform(-9.0, 9.0)))
        it.step(0.01 * i, 0.01)
        seen += it.get("Real", POSITION, VELOCITY, ENERGY)
    it.free()
    return seen


def test_threads_are_equal_to_serial(lib, resources):
    serial = [trajectory(lib, resources, seed) for seed in range(4)]
    found = [None] * 4

    def run(seed):
        found[seed] = trajectory(lib, resources, seed)

    threads = [threading.Thread(target=run, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == serial


def test_prints_the_time_of_a_scalar_get(toy):
    toy.ready()
    references, value = (c_uint * 100_000)(*[VELOCITY] * 100_000), (c_double * 100_000)()
    start = time.perf_counter()
    toy.call("GetReal", references, 100_000, value)
    each = time.perf_counter() - start
    one = (c_uint * 1)(VELOCITY)
    start = time.perf_counter()
    for _ in range(10_000):
        toy.lib.fmi2GetReal(toy.handle, one, 1, value)
    print(f"\nget: {each / 1e5 * 1e9:.1f} ns a value in one call; {(time.perf_counter() - start) / 1e4 * 1e9:.0f} ns a call through ctypes")


# platforms


@pytest.mark.parametrize("target", TARGETS)
def test_links_for_other_platforms(target):
    data = compiled(target).read_bytes()
    print(f"\n{target}: {len(data)} bytes")
    assert data.startswith(TARGETS[target])


def imports_of(data):
    """Names of the libraries that a Windows library (PE32+) needs."""
    (head,) = struct.unpack_from("<I", data, 0x3C)
    n, optional = struct.unpack_from("<H", data, head + 6)[0], struct.unpack_from("<H", data, head + 20)[0]
    table = struct.unpack_from("<I", data, head + 24 + 112 + 8)[0]
    sections = [struct.unpack_from("<4I", data, head + 24 + optional + 40 * i + 8) for i in range(n)]

    def place(address):
        return next(raw + address - start for size, start, raw_size, raw in sections if start <= address < start + max(size, raw_size))

    names, at = [], place(table)
    while name := struct.unpack_from("<I", data, at + 12)[0]:
        names.append(data[place(name) : data.index(b"\0", place(name))].decode().lower())
        at += 20
    return names


def test_windows_needs_its_own_libraries_only():
    names = imports_of(compiled("x86_64-windows-gnu").read_bytes())
    assert "kernel32.dll" in names
    assert all(name.startswith(("kernel32.", "api-ms-win-crt-", "ucrtbase.", "msvcrt.")) for name in names), names


# random calls under the sanitizer, in a process of its own


def test_random_calls(resources):
    path = compiled(LINUX, "-fsanitize=undefined", "-fsanitize-trap=undefined")  # ends at the first fault
    support = Path(__file__).parents[1] / "support"
    program = [sys.executable, support / "face_fuzz.py", path, resources, "3", "1"]
    done = subprocess.run(program, env=os.environ | {"PYTHONPATH": str(support)}, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-2000:]
    assert int(done.stdout.split()[0]) > 10_000  # calls


# unit.bin


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (Row("x", "local"), "x: local of kind Real: there is no such variable"),
        (Row("x", "input", "String"), "x: input of kind String"),
        (Row("x", "output", index=2), "x: index = 2: must be below 2, the number of outputs"),
        (Row("x", "output", group=1), "x: group = 1: must be below 1"),
        (Row("x\0", "output"), "must hold no zero byte"),
    ],
)
def test_tables_that_do_not_fit(row, words):
    vectors = {"kernels": 1, "constants": [], "state": [], "inputs": [], "parameters": [], "n_outputs": 2, "n_groups": 1}
    assert len(unit_file("x", GUID, [], [], **vectors)) == 120 + 16
    with pytest.raises(ValueError, match=words):
        unit_file("x", GUID, [row], [], **vectors)
    with pytest.raises(ValueError, match="guid = "):
        unit_file("x", "x" * 64, [], [], **vectors)
    with pytest.raises(ValueError, match=r"inputs \[0\]: have no variable"):
        unit_file("x", GUID, [], [], **{**vectors, "inputs": [1.0]})
