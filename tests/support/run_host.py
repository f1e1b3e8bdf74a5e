"""A host on exported files, as a program: ``run_host.py HOST FOLDER STEP END RESULT``.

Writes to the file RESULT one line of JSON per step: time, hang-off position (3) [m], work done on the pipe and on the vessel through the
bond [J], all as the FMUs report them. Each host is a function from (folder, step, end) to these rows.
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


def own(folder: Path, step: float, end: float) -> Rows:
    """The master of this package: energy-consistent, iterated with rollback."""
    from master.coupling.end import impedance_end, mobility_end
    from master.coupling.energy_consistent import EnergyConsistent
    from master.coupling.hang_off import hang_off
    from master.fmu.instance import Fmu

    with Fmu(folder / "pipe.fmu", "pipe") as pipe, Fmu(folder / "vessel.fmu", "vessel") as vessel:
        pipe.initialize()
        vessel.initialize(inputs={name: pipe.get(name) for name in ("force", "moment")})
        bond = hang_off()
        coupling = EnergyConsistent(impedance_end(pipe, bond), mobility_end(vessel, bond), bond, step)
        for i in range(round(end / step)):
            time = i * step
            while (i + 1) * step - time > 1e-9 * step:
                time += coupling.advance(time, (i + 1) * step - time).step
            yield [time, *vessel.get("hang_off_position"), *pipe.get("top_work"), *vessel.get("bond_work")]


def fmpy_ssp(folder: Path, step: float, end: float) -> Rows:
    """FMPy's simulation of the SSP file: a fixed step, all connected inputs zero in the first."""
    from fmpy.ssp.simulation import simulate_ssp

    result = simulate_ssp(str(folder / "system.ssp"), stop_time=end - 0.5 * step, step_size=step)
    columns = [result[f"{unit}.{name}"] for unit, name in WATCHED]
    for time, *values in zip(result["time"], *columns, strict=True):
        yield [time + step, *values]


def libcosim(folder: Path, step: float, end: float) -> Rows:
    """libcosim on the OSP structure with its fixed step."""
    return _structure(folder / "OspSystemStructure.xml", "BaseStepSize", step, end)


def ecco_file(folder: Path, step: float, end: float) -> Rows:
    """libcosim on the OSP structure for ECCO: one power bond."""
    return _structure(folder / "OspSystemStructure_ecco.xml", "StepSize", step, end)


def ecco(folder: Path, step: float, end: float) -> Rows:
    """libcosim's ECCO with all six products of effort and flow as power bonds."""
    from libcosimpy.CosimAlgorithm import CosimAlgorithm, EccoParams
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimSlave import CosimLocalSlave

    given = dict(re.findall(r"<(\w+)>([0-9.e-]+)<", (folder / "OspSystemStructure_ecco.xml").read_text()))
    names = {"safety_factor": "SafetyFactor", "min_step_size": "MinimumStepSize", "max_step_size": "MaximumStepSize",
             "min_change_rate": "MinimumChangeRate", "max_change_rate": "MaximumChangeRate", "p_gain": "ProportionalGain",
             "i_gain": "IntegralGain", "abs_tolerance": "AbsoluteTolerance", "rel_tolerance": "RelativeTolerance"}  # fmt: skip
    algorithm = CosimAlgorithm.create_ecco_algorithm(EccoParams(step_size=step, **{key: float(given[it]) for key, it in names.items()}))
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
    """Ecos on the SSP file."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(folder / "system.ssp"), step_size=step) as simulation:
        simulation.init()
        while simulation.get_time() < end - 0.5 * step:
            simulation.step(1)
            yield [simulation.get_time(), *(simulation.get_real(f"{unit}::{name}") for unit, name in WATCHED)]


def cofmupy(folder: Path, step: float, end: float) -> Rows:
    """CoFmuPy on the FMUs (Jacobi), by the wires of the OSP structure.

    It puts zeros into all inputs, also those without a connection, unless told otherwise: here the start values they have in the FMU.
    """
    import fmpy
    from cofmupy import Coordinator

    wires = [(f"{out}[{i}]", f"{held}[{i}]", f"{effort}[{i}]") for out, held, effort in BOND for i in "123"]
    pulls = [effort for _, _, effort in wires]
    connections = [("vessel", out, "pipe", held) for out, held, _ in wires] + [("pipe", pull, "vessel", pull) for pull in pulls]
    fmus = [{"id": name, "path": f"{folder}/{name}.fmu", "initialization": {}} for name in ("pipe", "vessel")]
    vessel = fmpy.read_model_description(str(folder / "vessel.fmu"), validate=False)
    fmus[1]["initialization"] = {variable.name: float(variable.start) for variable in vessel.modelVariables if variable.name in pulls}
    coordinator = Coordinator()
    coordinator.start({
        "fmus": fmus,
        "connections": [{"source": {"id": a, "variable": b}, "target": {"id": c, "variable": d}} for a, b, c, d in connections],
    })  # fmt: skip
    for _ in range(round(end / step)):
        coordinator.do_step(step)
        yield [coordinator.master.current_time, *(float(coordinator.get_variable(place)[0]) for place in WATCHED)]


def _structure(path: Path, element: str, step: float, end: float) -> Rows:
    """libcosim on an OSP structure, whose first `element` is set to `step`."""
    from libcosimpy.CosimExecution import CosimExecution

    path.write_text(re.sub(f"<{element}>.*?<", f"<{element}>{step}<", path.read_text(), count=1))
    return _march(CosimExecution.from_osp_config_file(osp_path=str(path)), end)


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
            result.write(json.dumps([float(value) for value in row]) + "\n")
