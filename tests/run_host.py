"""A foreign host on exported files, as a program: ``run_host.py HOST FOLDER STEP END RESULT``.

Writes to the file RESULT one line of JSON per step: time, hang-off position (3) [m],
work done on the pipe and on the vessel through the bond [J].
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

WATCHED = [("vessel", f"hang_off_position[{i}]") for i in (1, 2, 3)] + [("pipe", "top_work"), ("vessel", "bond_work")]
BOND = (("end_velocity", "velocity", "force"), ("end_angular_velocity", "angular_velocity", "moment"))
NANO = 1e-9  # s, libcosim's unit of time
Rows = Iterator[list[float]]


def libcosim(folder: Path, step: float, end: float) -> Rows:
    """The OSP structure with its fixed step."""
    from libcosimpy.CosimExecution import CosimExecution

    structure = folder / "OspSystemStructure.xml"
    structure.write_text(re.sub("<BaseStepSize>.*?<", f"<BaseStepSize>{step}<", structure.read_text()))
    return _march(CosimExecution.from_osp_config_file(osp_path=str(folder)), end)


def ecco(folder: Path, step: float, end: float) -> Rows:
    """The bond's six products of effort and flow as power bonds; the step follows from their residual."""
    from libcosimpy.CosimAlgorithm import CosimAlgorithm, EccoParams
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimSlave import CosimLocalSlave

    parameters = EccoParams(
        step_size=step, min_step_size=step / 10, max_step_size=0.1, min_change_rate=0.2, max_change_rate=1.5, abs_tolerance=1.0,
        rel_tolerance=1e-3,
    )  # fmt: skip
    algorithm = CosimAlgorithm.create_ecco_algorithm(parameters)
    execution = CosimExecution.from_algorithm(algorithm)
    pipe, vessel = (execution.add_local_slave(CosimLocalSlave(f"{folder}/{name}.fmu", name)) for name in ("pipe", "vessel"))
    references = _references(execution)
    for out, held, effort in BOND:
        for i in "123":
            flow, hold = references["vessel", f"{out}[{i}]"], references["pipe", f"{held}[{i}]"]
            pull, push = references["pipe", f"{effort}[{i}]"], references["vessel", f"{effort}[{i}]"]
            execution.connect_real_variables(vessel, flow, pipe, hold)
            execution.connect_real_variables(pipe, pull, vessel, push)
            if algorithm.add_power_bond(vessel, flow, push, pipe, pull, hold):
                raise RuntimeError("power bond refused")
    return _march(execution, end)


def ecos(folder: Path, step: float, end: float) -> Rows:
    """The SSP file."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(folder / "system.ssp"), step_size=step) as simulation:
        simulation.init()
        while simulation.get_time() < end - 0.5 * step:
            simulation.step(1)
            yield [simulation.get_time(), *(simulation.get_real(f"{unit}::{name}") for unit, name in WATCHED)]


def _march(execution: Any, end: float) -> Rows:
    from libcosimpy.CosimObserver import CosimObserver

    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    places = {_text(info.name): info.index for info in execution.slave_infos()}
    references = _references(execution)
    while execution.status().current_time * NANO < end - 1e-6:
        if not execution.step():
            raise RuntimeError("step failed")
        values = [observer.last_real_values(places[unit], [references[unit, name]])[0] for unit, name in WATCHED]
        yield [execution.status().current_time * NANO, *values]


def _references(execution: Any) -> dict[tuple[str, str], int]:
    return {
        (_text(info.name), _text(variable.name)): variable.reference
        for info in execution.slave_infos()
        for variable in execution.slave_variables(slave_index=info.index)
    }


def _text(name: Any) -> str:
    return name.decode() if isinstance(name, bytes) else name


if __name__ == "__main__":
    with open(sys.argv[5], "w", encoding="utf-8") as result:
        for row in globals()[sys.argv[1]](Path(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])):
            result.write(json.dumps(row) + "\n")
