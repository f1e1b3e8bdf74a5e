"""An FMU in machine code: libraries for every platform asked for, and the data of one unit with its parameters (`unit.bin`)."""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import os
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import numpy as np

from .. import cache, licenses, schema
from ..adapter import UnitSlave
from ..build import CAPABILITIES, EPOCH, Recipe, about, content
from ..cache import cache_folder
from ..description import Variable
from ..document import icon_png, page_html
from ..ports import Ports
from .machine import HERE, SOURCES, Machine, Platform, joined, kinship, library
from .tables import Row, unit_file

_SIZES = 7  # numbers before a unit's constants, see kernels.c
_OWN = (*SOURCES, "machine.py", "export.py", "tables.py")


def native_fmu(recipe: Recipe, platforms: Sequence[Platform], destination: Path | None = None) -> Path:
    """The FMU of `recipe` in machine code for `platforms`, in the file `destination`, or in a cache by content.

    The unit is of a package whose module `native` has its kernels. Raises ValueError for parameters that it refuses, RunError where a
    library cannot be made or the unit does not start.
    """
    place = destination or cache_folder("fmus") / f"{recipe.name}_{_digest(recipe, platforms)}.fmu"
    if destination is None and cache.used(place) and zipfile.is_zipfile(place):
        return place
    unit = recipe.unit_class(schema.build(recipe.unit_class.PARAMETERS, recipe.parameters))
    native = kernels_of(unit)
    machine = functools.cache(lambda: machine_of(unit))  # made when a library is not kept
    libraries: dict[str, list[bytes]] = {}
    for platform in platforms:
        made = library(machine, platform, recipe.name, recipe.bundle, cache_folder("libraries"))
        libraries.setdefault(f"binaries/{platform.folder}/{recipe.name}.{platform.ending}", []).append(made)
    place.parent.mkdir(parents=True, exist_ok=True)
    finished = place.with_name(f".{os.getpid()}_{place.name}")
    files = {name: joined(parts) for name, parts in libraries.items()}
    _write(finished, files | _described(recipe, unit, native, _digest(recipe, platforms)))
    finished.replace(place)
    if destination is None:
        cache.bound()
    return place


def kernels_of(unit: Any) -> ModuleType:
    """The module `native` of a unit's package."""
    return importlib.import_module(f"{type(unit).__module__.rpartition('.')[0]}.native")


def machine_of(unit: Any) -> Machine:
    """The compiled kernels of a unit."""
    unit.compile()
    return Machine(kernels_of(unit))


def _digest(recipe: Recipe, platforms: Sequence[Platform]) -> str:
    digest = hashlib.sha256(repr((recipe.digest, tuple(platforms))).encode())
    for source in _OWN:
        digest.update((HERE / source).read_bytes())
    return digest.hexdigest()[:12]


def _described(recipe: Recipe, unit: Any, native: ModuleType, digest: str) -> dict[str, bytes]:
    """The files of an FMU beside its libraries."""
    guid = str(uuid.uuid5(uuid.NAMESPACE_URL, digest))
    with tempfile.TemporaryDirectory(prefix="fmu_") as folder:
        facts = {"about": {**about(recipe), "guid": guid}, **content(recipe)}
        Path(folder, "fmu.json").write_text(json.dumps(facts), encoding="utf-8")

        free = native.value_places(unit.parameters)

        class Slave(UnitSlave):
            unit_class = type(unit)

            def variables(self) -> list[Variable]:
                """See UnitSlave; the description says of a parameter whether it is fixed at export."""
                return [
                    replace(it, doc=f"{it.doc} (fixed at export)".strip())
                    if it.causality == "parameter" and self.own_name(it.name) not in free
                    else it
                    for it in super().variables()
                ]

        slave = Slave(instance_name=recipe.name, resources=folder, visible=False)
    model = slave.to_xml({name: str(value).lower() for name, value in (CAPABILITIES | {"needsExecutionTool": False}).items()})
    model.set("generationTool", f"pipelay {slave.version}")
    model.set("generationDateAndTime", "1980-01-01T00:00:00Z")  # equal contents, equal bytes
    ElementTree.indent(model)
    text = recipe.package / "about.html"
    page = page_html(model, text.read_text(encoding="utf-8") if text.is_file() else "")
    return {
        "modelDescription.xml": ElementTree.tostring(model, "utf-8", xml_declaration=True),
        "documentation/index.html": page.encode(),
        "model.png": icon_png(),
        "resources/unit.bin": unit_data(recipe, guid, slave, unit, native),
        **licenses.entry(recipe.name, recipe.license, recipe.author),
        **licenses.of_package("pipelay"),
        **licenses.of_package("numba"),
    }


def unit_data(recipe: Recipe, guid: str, slave: UnitSlave, unit: Any, native: ModuleType) -> bytes:
    """The content of unit.bin: see tables.py."""
    ports: Ports = slave.ports
    held = ports.held(ports.start)
    if (message := unit.initialize(0.0, held)) is not None:
        raise ValueError(message)
    places = native.output_places(unit.parameters)
    numbers, fixed = list(native.values(unit.parameters)), native.value_places(unit.parameters)
    rows = []
    for variable in ports.variables({}, {}):
        port, _, rest = variable.name.partition("[")
        if variable.causality == "output":
            part, group = places[port]
            at = part.start + (int(rest[:-1]) - 1 if rest else 0)
            rows.append(Row(variable.name, "output", variable.kind, at, group))
        elif variable.causality == "input":
            rows.append(Row(variable.name, "input", index=len([row for row in rows if row.causality == "input"])))
        else:
            rows.append(_parameter(variable.name, slave, fixed, numbers))
    n_outputs = max(part.stop for part, _ in places.values())
    remarks = [line.replace("%", "%%") for line in unit.remark.splitlines() if line not in _said_by_kernels(unit, native)]
    sizes = [_SIZES + len(unit.constants), len(unit.state), len(ports.start), n_outputs, len(numbers), len(native.MESSAGES), len(remarks)]
    return unit_file(
        recipe.name,
        guid,
        rows,
        [*native.MESSAGES, *remarks],
        kernels=kinship(recipe.bundle),
        constants=np.concatenate([np.array(sizes, dtype=float), unit.constants]),
        state=unit.state,
        inputs=ports.start,
        parameters=numbers,
        n_outputs=n_outputs,
        n_groups=native.N_GROUPS,
    )


def _said_by_kernels(unit: Any, native: ModuleType) -> list[str]:
    """What the unit's kernels say of its start."""
    words = importlib.import_module(f"{native.__package__}.notes")
    notes, state = np.zeros(words.SIZE), unit.state.copy()
    native.unit_start(unit.constants, unit.constants, unit.state, np.zeros(native.N_INPUTS), 0.0, state, notes)
    said: list[str] = words.texts(notes, native.MESSAGES)
    return said


def _parameter(name: str, slave: UnitSlave, places: Mapping[str, int], numbers: list[float]) -> Row:
    """The row of a parameter; one that the kernels do not know is fixed, its number put behind theirs."""
    it = slave.ports.parameters[name]
    own = slave.own_name(name)
    if it.kind == "String":
        return Row(name, "parameter", "String", text=str(it.value), fixed=True)
    kind = "Integer" if it.kind == "Enumeration" else it.kind
    if own not in places:
        numbers.append(float(slave.ports.as_number(name, it.value)))
    index = places.get(own, len(numbers) - 1)
    return Row(
        name,
        "parameter",
        kind,
        index,
        rule=it.rule,
        minimum=it.minimum,
        maximum=it.maximum,
        above=it.above,
        below=it.below,
        fixed=own not in places,
        items=it.items,
    )


def _write(path: Path, files: Mapping[str, bytes]) -> None:
    """A zip file in fixed order and with fixed dates."""
    with zipfile.ZipFile(path, "w") as target:
        for name in sorted(files):
            target.writestr(zipfile.ZipInfo(name, EPOCH), files[name], zipfile.ZIP_DEFLATED, compresslevel=9)
