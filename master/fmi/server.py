"""Answers the loader's requests (see loader.c): bytes in, bytes out, and no exception leaves it.

Request: function and instance (int32), arguments. Answer: status and length of the result (uint32), result, then the log as
records of status (int32), category and message (both end with a zero byte). Travels inside every exported FMU.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from .failure import Refused, printable, where

OK, DISCARD, ERROR = 0, 2, 3
HEAD, REPLY = struct.Struct("ii"), struct.Struct("II")
FORMATS = "dii"  # of real, integer, boolean
GETTERS = ("get_real", "get_integer", "get_boolean", "get_string")
SETTERS = ("set_real", "set_integer", "set_boolean", "set_string")


class _Slot:
    """One instance: its slave, its saved states, and how to make the slave anew."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self.make, self.slave = make, make()
        self.states: dict[int, Any] = {}


class Server:
    """All instances that one loader has made of `slave_class`."""

    def __init__(self, slave_class: Callable[..., Any]) -> None:
        self.slave_class = slave_class
        self.slots: dict[int, _Slot] = {}
        self.functions: list[Callable[[_Slot, memoryview], bytes | None]] = [
            self._setup,
            lambda slot, _: slot.slave.enter_initialization_mode(),
            lambda slot, _: slot.slave.exit_initialization_mode(),
            lambda slot, _: slot.slave.terminate(),
            self._reset,
            self._step,
            self._get_state,
            self._set_state,
            self._free_state,
            self._state_size,
            self._state_bytes,
            self._read_state,
        ]

    def answer(self, request: bytes) -> bytes:
        """The answer to one request."""
        function, instance = HEAD.unpack_from(request)
        status, result, log = OK, b"", b""
        slot = self.slots.get(instance)
        try:
            result = self._call(function, instance, slot, memoryview(request)[8:]) or b""
        except _DiscardedError:
            status = DISCARD
        except Exception as error:  # all there is: a host must never see one
            text = str(error) if isinstance(error, Refused | ValueError) else where(error)
            status, log = ERROR, _record(ERROR, "logStatusError", printable(text))
        if slot is not None and slot.slave.log_queue:
            queue = slot.slave.log_queue
            log = b"".join(_record(it.status.value, it.category, it.msg) for it in queue) + log
            queue.clear()
        return REPLY.pack(status, len(result)) + result + log

    def _call(self, function: int, instance: int, slot: _Slot | None, data: memoryview) -> bytes | None:
        if function == 0:
            self._instantiate(instance, data)
            return None
        if slot is None:
            raise Refused(f"instance {instance}: there is none")
        if function >= 30:
            return self._set(slot, function - 30, data)
        if function >= 20:
            return self._get(slot, function - 20, data)
        if function == 1:
            del self.slots[instance]
            return None
        return self.functions[function - 2](slot, data)

    def _instantiate(self, instance: int, data: memoryview) -> None:
        name, guid, resources = _texts(data)
        slot = _Slot(lambda: self.slave_class(instance_name=name, resources=resources, visible=False))
        if guid != slot.slave.guid:
            raise Refused(f"GUID = {guid}: must be {slot.slave.guid}, as in modelDescription.xml")
        self.slots[instance] = slot

    @staticmethod
    def _reset(slot: _Slot, _: memoryview) -> None:
        slot.slave = slot.make()

    @staticmethod
    def _setup(slot: _Slot, data: memoryview) -> None:
        tolerant, tolerance, start, limited, stop = struct.unpack("5d", data)
        slot.slave.setup_experiment(start, stop if limited else None, tolerance if tolerant else None)

    @staticmethod
    def _step(slot: _Slot, data: memoryview) -> None:
        if not slot.slave.do_step(*struct.unpack("2d", data)):
            raise _DiscardedError

    @staticmethod
    def _get(slot: _Slot, kind: int, data: memoryview) -> bytes:
        references = data.cast("I").tolist()
        values = getattr(slot.slave, GETTERS[kind])(references)
        if kind < 3:
            try:
                return struct.pack(f"{len(values)}{FORMATS[kind]}", *values)
            except struct.error:
                raise Refused(f"value references {references}: not all of the type asked for") from None
        if not all(isinstance(value, str) for value in values):
            raise Refused(f"value references {references}: not all are strings")
        return b"".join(value.encode() + b"\0" for value in values)

    @staticmethod
    def _set(slot: _Slot, kind: int, data: memoryview) -> None:
        (n,) = struct.unpack_from("I", data)
        references, rest = data[4 : 4 + 4 * n].cast("I").tolist(), data[4 + 4 * n :]
        values: list[Any] = _texts(rest) if kind == 3 else list(struct.unpack(f"{n}{FORMATS[kind]}", rest))
        getattr(slot.slave, SETTERS[kind])(references, [bool(value) for value in values] if kind == 2 else values)

    # states

    @staticmethod
    def _get_state(slot: _Slot, data: memoryview) -> None:
        slot.states[_number(data)] = slot.slave._get_fmu_state()

    @staticmethod
    def _set_state(slot: _Slot, data: memoryview) -> None:
        slot.slave._set_fmu_state(_state(slot, data))

    @staticmethod
    def _free_state(slot: _Slot, data: memoryview) -> None:
        _state(slot, data)
        del slot.states[_number(data)]

    @staticmethod
    def _state_size(slot: _Slot, data: memoryview) -> bytes:
        return struct.pack("Q", len(slot.slave._fmu_state_to_bytes(_state(slot, data))))

    @staticmethod
    def _state_bytes(slot: _Slot, data: memoryview) -> bytes:
        return slot.slave._fmu_state_to_bytes(_state(slot, data))

    @staticmethod
    def _read_state(slot: _Slot, data: memoryview) -> None:
        slot.states[_number(data)] = slot.slave._fmu_state_from_bytes(bytes(data[8:]))


class _DiscardedError(Exception):
    """The step was not done; the slave has logged why."""


def _state(slot: _Slot, data: memoryview) -> Any:
    number = _number(data)
    if number not in slot.states:
        raise Refused(f"state {number}: unknown, or freed before")
    return slot.states[number]


def _number(data: memoryview) -> int:
    return int(struct.unpack_from("Q", data)[0])


def _texts(data: memoryview) -> list[str]:
    return [text.decode("utf-8", "replace") for text in bytes(data).split(b"\0")[:-1]]


def _record(status: int, category: str, message: str) -> bytes:
    return struct.pack("i", status) + b"".join(text.replace("\0", " ").encode() + b"\0" for text in (category, message))
