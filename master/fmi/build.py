"""Packs a unit package into an FMU: adapter and schema join it under a name with a content hash.

An FMU carries its unit as a package of its own (``pipe_fmu_<hash>``, see `entry`), so building in a process that later
runs FMUs mixes nothing up; still, a build imports the unit, so a program that wants its FMU runs free of it builds in
a child process.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import numba
from llvmlite import binding
from pythonfmu import FmuBuilder

from ..errors import RunError
from ..process.locks import locked
from . import cache, entry, licenses, loader
from .cache import cache_folder
from .document import icon_png, page_html
from .loader import interpreter

HERE = Path(__file__).parent
BUNDLED = ("adapter.py", "description.py", "failure.py", "ports.py", "schema.py", "server.py", "state.py")
LINUX = "binaries/linux64/"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip archive can hold: equal contents, equal bytes
CAPABILITIES = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}


@dataclass(frozen=True)
class Recipe:
    """What goes into an FMU.

    `package` is the folder of the unit package, `unit` the place of its class in it (``slave.PipeUnit``), `parameters`
    the nested mapping that becomes the defaults. Without a `description` the unit's own is taken. `experiment` may hold
    start_time, stop_time, step_size, tolerance; `inputs` the start values of inputs that do not start at zero. `nominal` holds nominal
    values by port, where they are not those of its unit of measure.
    """

    package: Path
    unit: str
    parameters: Mapping[str, Any]
    description: str = ""
    author: str = "the pipelay authors"
    license: str = "MIT"
    experiment: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, Sequence[float]] = field(default_factory=dict)
    nominal: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """FMI model name: the class without its ending, ``Pipe``."""
        return self.unit.rpartition(".")[2].removesuffix("Unit")

    @property
    def unit_class(self) -> Any:
        """The class, of the package as Python finds it by its name."""
        module, _, name = self.unit.rpartition(".")
        return getattr(importlib.import_module(f"{self.package.name}.{module}"), name)

    @functools.cached_property
    def bundle(self) -> str:
        """Name of the package inside the FMU, with the hash of all its sources."""
        return f"{self.package.name}_{_digest(_sources(self))}"

    @property
    def digest(self) -> str:
        """Hash of everything the FMU's content follows from."""
        facts = {"about": about(self), **content(self)}
        return _digest({"bundle": self.bundle, "facts": json.dumps(facts, sort_keys=True)})


def build_fmu(recipe: Recipe, destination: Path) -> Path:
    """Write the FMU to the file `destination`, whole or not at all.

    Raises ValueError if the unit refuses its parameters or declares a unit of measure that is not understood, RunError without a
    compiler.
    """
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="fmu_") as folder, _clean_imports():
        script, configuration = Path(folder, f"{recipe.bundle}_entry.py"), Path(folder, "fmu.json")
        shutil.copy(HERE / "entry.py", script)
        facts = {"about": {**about(recipe), "guid": str(uuid.uuid5(uuid.NAMESPACE_URL, recipe.digest))}, **content(recipe)}
        configuration.write_text(json.dumps(facts, indent=1), encoding="utf-8")
        bundle = Path(folder, recipe.bundle)
        for name, text in _sources(recipe).items():
            target = bundle / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(text)
        capabilities = {**CAPABILITIES, "needsExecutionTool": True}
        raw = FmuBuilder.build_FMU(script, dest=Path(folder, "raw.fmu"), project_files=[bundle, configuration], **capabilities)
        finished = destination.with_name(f".{os.getpid()}_{destination.name}")
        _finish(recipe, Path(raw), finished)
        finished.replace(destination)
    return destination


def cached_fmu(recipe: Recipe, folder: Path) -> Path:
    """The FMU of this recipe in `folder`, built if it is not there: ``folder/Pipe_<hash>.fmu``."""
    path = folder / f"{recipe.name}_{recipe.digest}.fmu"
    if not (cache.used(path) and zipfile.is_zipfile(path)):
        build_fmu(recipe, path)
        cache.bound()
    return path


def compile_kernels(recipe: Recipe, fmu: Path) -> None:
    """Have numba compile the kernels of this recipe's `fmu`, unless all of them are, so that a process that runs it loads them.

    A process that compiles kernels binds them otherwise than one that loads them, with other round-off: the first run would
    differ from the later ones in the last bits. Where two processes ask at once, one waits for the other. Raises RunError if the
    FMU does not start.
    """
    unit = cache_folder("units") / recipe.bundle
    mark = unit / entry.COMPILED.format(_compiler())
    with locked(fmu):
        if not (mark.is_file() and any(unit.rglob("*.nbi"))):
            with tempfile.TemporaryDirectory(prefix="fmu_") as folder, zipfile.ZipFile(fmu) as archive:
                archive.extractall(folder, [name for name in archive.namelist() if name.startswith("resources/")])
                _start(Path(folder, "resources"), recipe.experiment.get("step_size", 0.01))
            with contextlib.suppress(OSError):  # settled elsewhere
                mark.touch()


def _start(resources: Path, step: float) -> None:
    """Start the unit of an unpacked FMU once, in a process of its own, so that its kernels are compiled. Raises RunError."""
    command = [sys.executable, "-I", "-B", str(HERE / "warm.py"), str(resources), str(step)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RunError(f"the FMU does not start: {' '.join(done.stderr.split())[-1000:]}")


def bundled_package(fmu: Path) -> ModuleType:
    """The unit package inside an FMU file, imported from where the FMU itself imports it.

    For a process that needs the unit's own interface: compiled kernels are then shared with the FMU.
    """
    with tempfile.TemporaryDirectory(prefix="fmu_") as folder, zipfile.ZipFile(fmu) as archive, _clean_imports():
        archive.extractall(folder, [name for name in archive.namelist() if name.startswith("resources/")])
        resources = Path(folder, "resources")
        sys.path.insert(0, str(resources))
        slave = importlib.import_module((resources / "slavemodule.txt").read_text())
        return sys.modules[slave.PACKAGE]


def _compiler() -> str:
    """Hash of what makes numba compile anew, beside the sources: its version and that of Python, the processor, its settings."""
    host = (binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_"))
    return hashlib.sha256(repr((sys.version, numba.__version__, host, settings)).encode()).hexdigest()[:12]


def about(recipe: Recipe) -> dict[str, str]:
    """What the model description says of an FMU."""
    try:
        version = importlib.metadata.version("pipelay")
    except importlib.metadata.PackageNotFoundError:
        version = "0"
    about = {"modelName": recipe.name, "author": recipe.author, "license": recipe.license, "version": version}
    return about | ({"description": recipe.description} if recipe.description else {})


def content(recipe: Recipe) -> dict[str, Any]:
    """What an FMU is made with: parameters, experiment, inputs, nominal values."""
    parts = {"experiment": recipe.experiment, "inputs": recipe.inputs, "nominal": recipe.nominal}
    return {"parameters": recipe.parameters} | {name: dict(part) for name, part in parts.items()}


def _sources(recipe: Recipe) -> dict[str, bytes]:
    """Files of the bundle by relative name: the unit package, the adapter, and the module that joins the two."""
    files = {
        path.relative_to(recipe.package).as_posix(): path.read_bytes()
        for path in sorted(recipe.package.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }
    module, _, name = recipe.unit.rpartition(".")
    files["fmi_unit.py"] = f"from .fmi.adapter import UnitSlave\nfrom .{module} import {name} as Unit\n".encode()
    files["fmi/__init__.py"] = b""
    files.update({f"fmi/{source}": (HERE / source).read_bytes() for source in BUNDLED})
    return files


def _digest(parts: Mapping[str, str | bytes]) -> str:
    digest = hashlib.sha256(importlib.metadata.version("pythonfmu").encode())
    for source in ("entry.py", "runtime.py", "loader.c"):
        digest.update((HERE / source).read_bytes())
    digest.update(interpreter().encode())
    for name, content in sorted(parts.items()):
        data = content.encode() if isinstance(content, str) else content
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()[:12]


def _finish(recipe: Recipe, raw: Path, finished: Path) -> None:
    """Repack compressed, in fixed order and with fixed dates; add documentation, icon and loader."""
    with zipfile.ZipFile(raw) as source:
        foreign = [name for name in source.namelist() if name.startswith("binaries/") and not name.startswith(LINUX)]
        contents = {name: source.read(name) for name in source.namelist() if name not in foreign}  # PythonFMU's, which find no Python
    model = ElementTree.fromstring(contents["modelDescription.xml"])
    text = recipe.package / "about.html"
    contents["documentation/index.html"] = page_html(model, text.read_text(encoding="utf-8") if text.is_file() else "").encode()
    contents["model.png"] = icon_png()
    for name in (name for name in contents if name.startswith(LINUX)):
        contents[name] = loader.library(cache_folder("loaders"))
    contents["resources/runtime.py"] = (HERE / "runtime.py").read_bytes()
    contents |= licenses.entry(recipe.name, recipe.license, recipe.author)
    contents |= licenses.of_package("pipelay") | licenses.of_package("pythonfmu")
    contents["resources/python.txt"] = interpreter().encode()
    with zipfile.ZipFile(finished, "w") as target:
        for name in sorted(contents):
            target.writestr(zipfile.ZipInfo(name, EPOCH), contents[name], zipfile.ZIP_DEFLATED)


@contextlib.contextmanager
def _clean_imports():  # type: ignore[no-untyped-def]
    """Undo what the builder does to sys.path, and forget the modules it imported from the temporary folder."""
    path, modules = list(sys.path), set(sys.modules)
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name.endswith("_entry"):
                del sys.modules[name]
