"""Which physics act in a scene, and which do not, in one line."""

from __future__ import annotations

from master.scene.reading import DEFAULTS, Scene
from master.scene.two_fmus import General


def acting(scene: Scene) -> str:
    """What acts in a run of the scene beside weight, elasticity and inertia, and what does not; empty for FMUs given as files."""
    if isinstance(scene.sections, General):
        return ""
    pipe, vessel, current = scene.mapping["pipe"], scene.mapping.get("vessel"), scene.mapping["environment"].get("current", {})
    sections = pipe.get("sections") or [{}]
    drag = [(pipe.get("section", {}) | one).get(key, 1.0) for one in sections for key in ("drag_normal", "drag_tangential")]
    bed, mass = pipe.get("seabed"), pipe.get("added_mass")
    internal = pipe.get("internal_damping", DEFAULTS["pipe.internal_damping"])
    numerical = pipe.get("numerical_damping", 0.0)
    physics = {
        "drag": any(drag),
        "current": any(current.get("velocity", ())),
        "added mass of the pipe": mass is not None and mass.get("coefficient", 1.0) > 0.0,
        "seabed": bed is not None,
        "friction on the bed": bed is not None and bed.get("friction", 0.0) > 0.0,
        f"internal damping ({internal:g} s)" if internal else "internal damping": internal > 0.0,
        f"numerical damping ({numerical:g})" if numerical else "numerical damping": numerical > 0.0,
    }
    if vessel is None:
        physics["motion of the top"] = scene.sections.top_motion is not None
    else:
        physics |= {"positioning": vessel.get("controller") is not None, "loads on the hull": scene.sections.tables is not None}
    on, off = ([name for name, acts in physics.items() if acts is which] for which in (True, False))
    return f"{', '.join(on) or 'weight alone'}; without {', '.join(off)}" if off else ", ".join(on)
