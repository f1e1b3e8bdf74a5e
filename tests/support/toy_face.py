"""The toy unit (toy_unit.c) behind the C face of native FMUs: compiled, with its unit.bin, and called through ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import os
import tempfile
from collections.abc import Sequence
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

from master.fmi.native import windows, zig
from master.fmi.native.tables import Row, unit_file

HERE = Path(__file__).parent
NATIVE = HERE.parents[1] / "master" / "fmi" / "native"
CACHE = Path(tempfile.gettempdir(), f"pipelay_toy_face_{os.getuid()}")
SOURCES = [NATIVE / "face.c", NATIVE / "unit.c", HERE / "toy_unit.c"]
KERNELS = 2**64 - 7
FLAGS = ("-std=c11", "-O2", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror", "-shared", "-s", f"-DKERNELS={KERNELS}u")
LINUX = "x86_64-linux-gnu.2.17"
OK, WARNING, DISCARD, ERROR = range(4)
GUID = "{toy}"
TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
MESSAGES = (
    "stiffness = %g: breaks the spring",
    "step of %g s at t = %.3g s: too long",
    "100 %% of %s after %+.2e s",
    "only a %s",
    "start pulled by %d N",
    "start refused",
    "remark",
    "step",
)
FORCE, SPARE, POSITION, VELOCITY, STEPS, ENERGY, CALLS, MASS, STIFFNESS, UNUSED, KIND, SILENT, MOST, PINNED, LABEL = range(15)
ROWS = (
    Row("force", "input", index=0),
    Row("spare[1]", "input", index=1),
    Row("position", "output", index=0),
    Row("velocity", "output", index=1),
    Row("steps", "output", "Integer", index=2),
    Row("energy", "output", index=3, group=1),
    Row("calls", "output", index=4, group=1),
    Row("mass", "parameter", index=0, minimum=0.0, above=True, rule="must be > 0 kg"),
    Row("stiffness", "parameter", index=1, minimum=0.0, rule="must be >= 0 N/m"),
    Row("unused", "parameter", index=2),
    Row("kind", "parameter", "Integer", index=3, items=("linear", "shifted")),
    Row("silent", "parameter", "Boolean", index=4),
    Row("most", "parameter", "Integer", index=5, minimum=1, maximum=9, rule="must be 1 to 9"),
    Row("pinned", "parameter", index=6, fixed=True),
    Row("label", "parameter", "String", text="50 % Öl"),
)
MASS_OF, STIFFNESS_OF, START = 2.0, 8.0, (0.25, -1.0)


def toy_file(rows: Sequence[Row] = ROWS, guid: str = GUID) -> bytes:
    """unit.bin of the toy unit."""
    return unit_file(
        "Toy", guid, rows, MESSAGES, kernels=KERNELS, constants=[MASS_OF, STIFFNESS_OF, 0.0], state=[*START, 0.0], inputs=[3.0, 0.0],
        parameters=[MASS_OF, STIFFNESS_OF, 0.0, 1.0, 0.0, 5.0, 0.1], n_outputs=5, n_groups=2,
    )  # fmt: skip


def compiled(target: str = LINUX, *flags: str, sources: Sequence[Path] = SOURCES) -> Path:
    """The library for `target`, compiled once for these sources and flags."""
    command = [*zig.COMMAND, "cc", "-target", target, *FLAGS, *flags]
    contents = [source.read_bytes() for source in [*sources, NATIVE / "face.h"]]
    place = CACHE / f"{hashlib.sha256(b''.join(contents) + repr(command[1:]).encode()).hexdigest()[:16]}.so"
    if not place.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CACHE) as work:
            made = Path(work, "made")
            end = windows.arguments(Path(work)) if "windows" in target else ["-fPIC", "-lm"]
            zig.run([*command, "-o", str(made), *map(str, sources), *end], CACHE, "the toy unit does not compile")
            made.replace(place)
    return place


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [("logger", c_void_p), ("allocate", c_void_p), ("free", c_void_p), ("finished", c_void_p), ("environment", c_void_p)]


def library(path: Path | None = None) -> ctypes.CDLL:
    """The functions of the face with the types of their arguments."""
    lib = ctypes.CDLL(str(path or compiled()))
    pointer, many = c_void_p, [POINTER(c_uint), c_size_t]
    types: dict[str, list[Any]] = {
        "Instantiate": [c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int],
        "FreeInstance": [pointer], "SetupExperiment": [pointer, c_int, c_double, c_double, c_int, c_double],
        **{name: [pointer] for name in ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset")},
        **{name: [pointer] for name in ("CancelStep", "EnterEventMode")},
        "DoStep": [pointer, c_double, c_double, c_int],
        **{f"{verb}{kind}": [pointer, *many, POINTER(kind_type)] for verb in ("Get", "Set")
           for kind, kind_type in TYPES.items()},
        "GetFMUstate": [pointer, POINTER(c_void_p)], "SetFMUstate": [pointer, c_void_p], "FreeFMUstate": [pointer, POINTER(c_void_p)],
        "SerializedFMUstateSize": [pointer, c_void_p, POINTER(c_size_t)], "SerializeFMUstate": [pointer, c_void_p, c_char_p, c_size_t],
        "DeSerializeFMUstate": [pointer, c_char_p, c_size_t, POINTER(c_void_p)],
        "GetRealStatus": [pointer, c_int, POINTER(c_double)], "GetBooleanStatus": [pointer, c_int, POINTER(c_int)],
        "GetStatus": [pointer, c_int, POINTER(c_int)],
    }  # fmt: skip
    for name, arguments in types.items():
        getattr(lib, f"fmi2{name}").argtypes = arguments
    lib.fmi2Instantiate.restype = c_void_p
    lib.fmi2GetVersion.restype = lib.fmi2GetTypesPlatform.restype = c_char_p
    return lib


class Toy:
    """One instance; `log` holds (status, category, message) as the host gets them."""

    def __init__(self, lib: ctypes.CDLL, location: str | None, guid: str | None = GUID, kind: int = 1, *, mute: bool = False) -> None:
        self.lib, self.log = lib, []  # type: ignore[var-annotated]
        self._logger = LOGGER(lambda _, name, status, category, text: self.log.append((status, category.decode(), text.decode())))
        callbacks = Callbacks(None if mute else ctypes.cast(self._logger, c_void_p))
        texts = [None if text is None else text.encode() for text in (guid, location)]
        self.handle = lib.fmi2Instantiate(b"toy", kind, *texts, byref(callbacks), 0, 0)

    def call(self, name: str, *arguments: Any) -> int:
        """Status of an FMI function."""
        return int(getattr(self.lib, f"fmi2{name}")(self.handle, *arguments))

    @property
    def said(self) -> str:
        """The last message, and no longer in the log."""
        return str(self.log.pop()[2])

    def free(self) -> None:
        self.lib.fmi2FreeInstance(self.handle)

    def ready(self, start: float = 0.0, stop: float | None = None) -> Toy:
        """Initialised."""
        assert self.call("SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0) == OK
        assert self.call("EnterInitializationMode") == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def set(self, kind: str, *pairs: tuple[int, Any]) -> int:
        """Status of setting (value reference, value)."""
        values = [value.encode() if isinstance(value, str) else value for _, value in pairs]
        array = TYPES[kind] * len(pairs)
        return self.call(f"Set{kind}", (c_uint * len(pairs))(*(r for r, _ in pairs)), len(pairs), array(*values))

    def get(self, kind: str, *references: int) -> Any:
        """Their values, or the status where that is no success."""
        array = (TYPES[kind] * len(references))()
        status = self.call(f"Get{kind}", (c_uint * len(references))(*references), len(references), array)
        return list(array) if status == OK else status

    def real(self, reference: int) -> float:
        (value,) = self.get("Real", reference)
        return float(value)

    def step(self, time: float, step: float) -> int:
        return self.call("DoStep", time, step, 1)

    def state(self, handle: c_void_p | None = None) -> c_void_p:
        """Handle of the present state."""
        handle = handle or c_void_p()
        assert self.call("GetFMUstate", byref(handle)) == OK
        return handle

    def bytes_of(self, handle: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call("SerializedFMUstateSize", handle, byref(size)) == OK
        data = ctypes.create_string_buffer(size.value)
        assert self.call("SerializeFMUstate", handle, data, size.value) == OK
        return data.raw

    def read(self, data: bytes) -> tuple[int, c_void_p]:
        handle = c_void_p()
        return self.call("DeSerializeFMUstate", data, len(data), byref(handle)), handle
