"""Remarks on a scene as it is written: keys that cannot act beside its others, and steps too coarse, or starts too sudden, for its motion.

What contradicts the rest of a scene is refused by its sections; here is what may be meant, and must not pass unseen.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from master.scene.reading import Scene, Sections
from master.scene.two_fmus import General

STEPS = 20  # a period: a sine then is 0.4 % short at its peaks
_STIFFNESSES = ("axial_stiffness", "shear_stiffness", "torsional_stiffness", "bending_stiffness")
INSTEAD = {
    "youngs_modulus": _STIFFNESSES,
    "poisson_ratio": ("shear_stiffness", "torsional_stiffness"),
    "density": ("mass",),
    "coating_density": ("mass",),
}
"""Keys of a pipe section, and those that act in their stead where they are all given."""
CONTROLLER = {"start": 30.0, "period": 0.5}
"""Defaults of [vessel.controller], whose package a run does not import; a test keeps them equal."""


def of(scene: Scene, *, at_rest: bool = False) -> dict[str, list[str]]:
    """The remarks under the name "scene", one line each, none if there is none; `at_rest` without those on the run."""
    if isinstance(scene.sections, General):
        return {}
    found = list(_idle(scene.mapping))
    if not at_rest and scene.sections.simulation is not None:
        found += [*_late(scene.sections, scene.mapping), *_coarse(scene.sections)]
    return {"scene": found} if found else {}


def _idle(said: Mapping[str, Any]) -> Iterator[str]:
    """Keys that others of the scene keep from acting."""
    pipe, current = said["pipe"], said["environment"].get("current")
    if "tolerance" in pipe and "nodes" in pipe:
        yield f"pipe.nodes = {pipe['nodes']}: does not act beside pipe.tolerance, which finds their number"
    sections = {"section": pipe.get("section", {})} | {f"sections[{i}]": one for i, one in enumerate(pipe.get("sections", []), 1)}
    for key, value in sections["section"].items():
        if len(sections) > 1 and all(key in one for name, one in sections.items() if name != "section"):
            yield f"pipe.section.{key} = {json.dumps(value)}: does not act, as all pipe.sections say their own"
    for name, section in sections.items():
        known = sections["section"] | section
        for key, others in INSTEAD.items():
            if key in section and all(other in known for other in others):
                yield f"pipe.{name}.{key} = {section[key]:g}: does not act beside {', '.join(others)}"
        if "coating_density" in section and not known.get("coating_thickness"):
            yield f"pipe.{name}.coating_density = {section['coating_density']:g}: does not act without coating_thickness"
    bed = pipe.get("seabed", {})
    if "friction_speed" in bed and not bed.get("friction"):
        yield f"pipe.seabed.friction_speed = {bed['friction_speed']:g}: does not act without pipe.seabed.friction"
    if current is not None and not any(current.get("velocity", ())):
        yield "environment.current: does not act without a velocity"


def _late(sections: Sections, said: Mapping[str, Any]) -> Iterator[str]:
    """What would act after the end of the run only, or between its steps."""
    run, current, vessel = sections.simulation, said["environment"].get("current", {}), said.get("vessel") or {}
    assert run is not None
    starts = {"environment.current": current.get("start", 0.0)}
    if "controller" in vessel:
        controller = CONTROLLER | vessel["controller"]
        starts["vessel.controller"] = controller["start"]
        if controller["period"] < (1.0 - 1e-9) * run.macro_step:
            yield f"vessel.controller.period = {controller['period']:g}: sampled only once in simulation.macro_step = {run.macro_step:g} s"
    for name, start in starts.items():
        if start >= run.duration:
            yield f"{name}.start = {start:g}: does not act before the end, simulation.duration = {run.duration:g} s"
    if late := [f"{instant:g}" for instant in run.snapshots if instant > run.duration]:
        yield f"simulation.snapshots: {', '.join(late)} s lie after the end, simulation.duration = {run.duration:g} s"


def _coarse(sections: Sections) -> Iterator[str]:
    """Steps and fade-in of a motion."""
    run, motion = sections.simulation, sections.top_motion
    if motion is None:
        return
    assert run is not None
    if not any(motion.amplitude):
        yield "top_motion.amplitude = (0, 0, 0): moves nothing"
    if run.macro_step > (1.0 + 1e-9) * motion.period / STEPS:
        rule = f"coarser than a twentieth of top_motion.period = {motion.period:g} s, peaks are missed"
        yield f"simulation.macro_step = {run.macro_step:g}: {rule}"
    if motion.fade_in < motion.period:
        how = f"with a jump of {motion.speed:.3g} m/s" if motion.fade_in == 0.0 else "within less than a period"
        yield f"top_motion.ramp = {motion.fade_in:g}: the motion starts {how}, which sends waves along the line"
