"""What a run says about itself: summary.json, the short table on the screen and the energy check's verdict in words."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from master.results.recorder import Table


def _last(signals: Table, *names: str) -> list[float]:
    return [float(v) for v in signals.columns(*names)[-1]]


def _largest(signals: Table, name: str) -> float:
    return float(signals.column(name).max())


def summarise(run: Mapping[str, Any], signals: Table) -> dict[str, Any]:
    """The content of summary.json: `run` (its name, pipe, how it ended, its effort and energy figures) and what was recorded.

    Parts that a scene does not have leave no key. JSON knows no infinities: what is not finite becomes null.
    """
    time = float(signals.column("time")[-1])
    summary: dict[str, Any] = {**run, "duration_s": time, "realtime_factor": time / run["wall_s"] if run["wall_s"] else None}
    made, exchanged = run["interface_residual_J"], run["exchanged_energy_J"]
    summary["interface_residual_percent"] = 100.0 * made / exchanged if exchanged else None
    if "x" in signals:
        summary |= {
            "pose_gap_m": _largest(signals, "pose_gap"),
            "final_vessel_position_m": _last(signals, "x", "y", "z"),
            "final_vessel_speed_m_s": math.hypot(*_last(signals, "surge_velocity", "sway_velocity", "heave_velocity")),
        }
    if "pose_gap_angle" in signals:
        summary["pose_gap_rad"] = _largest(signals, "pose_gap_angle")
    if "top_tension" in signals:
        summary |= {
            "top_tension_max_N": _largest(signals, "top_tension"),
            "top_tension_min_N": float(signals.column("top_tension").min()),
            "bending_moment_max_N_m": _largest(signals, "largest_bending_moment"),
            "von_mises_max_Pa": _largest(signals, "largest_von_mises"),
            "pipe_length_m": _last(signals, "pipe_length")[0],
        }
        if "largest_utilisation" in signals:
            summary["utilisation_max"] = _largest(signals, "largest_utilisation")
        summary["stretch_m"] = summary["pipe_length_m"] - run["unstretched_length_m"]
    return {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in summary.items()}


def write_summary(path: Path, summary: Mapping[str, Any]) -> None:
    """Write as JSON, one key a line; whole, or the file stays as it was. Raises OSError."""
    unfinished = path.with_name(f".{path.name}")
    try:
        unfinished.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def screen(summary: Mapping[str, Any], title: str) -> str:
    """A short table for the terminal."""
    steps = f"{summary['macro_steps']} steps ({summary['rejected_steps']} rejected)"
    speed = f", {summary['realtime_factor']:.1f} x real time" if summary["realtime_factor"] else ""
    rows = [("simulated", f"{summary['duration_s']:g} s in {steps}; {summary['wall_s']:.1f} s of wall time{speed}")]
    if summary["status"] != "completed":
        stopped = summary["status"] == "stopped"  # the energy check's own row says why
        rows.append((summary["status"], "by the energy check" if stopped else summary["message"]))
    if "final_vessel_position_m" in summary:
        (x, y, z), angle = summary["final_vessel_position_m"], summary.get("pose_gap_rad")
        place = f"x {x:.3f}  y {y:.3f}  z {z:.3f} m, moving at {summary['final_vessel_speed_m_s']:.4f} m/s"
        rows += [
            ("vessel at the end", place),
            ("largest pose gap", f"{summary['pose_gap_m']:.1e} m" + (f", {angle:.1e} rad" if angle is not None else "")),
        ]
    if "top_tension_min_N" in summary:
        low, high = summary["top_tension_min_N"] / 1e3, summary["top_tension_max_N"] / 1e3
        bending, stress = summary["bending_moment_max_N_m"] / 1e3, summary["von_mises_max_Pa"] / 1e6
        used = f", utilisation {summary['utilisation_max']:.3f}" if "utilisation_max" in summary else ""
        rows += [
            ("top tension", f"{low:.2f} to {high:.2f} kN"),
            ("largest bending", f"{bending:.2f} kN m, von Mises stress {stress:.1f} MPa{used}"),
            ("pipe length", f"{summary['pipe_length_m']:.4f} m at the end"),
        ]
    made, share = summary["interface_residual_J"], summary["interface_residual_percent"]
    exchanged = f"{summary['exchanged_energy_J']:.3g} J exchanged" + ("" if share is None else f" ({share:.2g} %)")
    left = f"the bond made {made:.2g} J of {exchanged}"
    rows += [("coupling", f"{summary['coupling']}; {left}"), ("energy check", summary["energy_check"].removeprefix("energy check "))]
    if summary["physics"]:
        rows.insert(0, ("physics", summary["physics"]))
    rows += [(f"{name} start", words) for name, remarks in summary["start_remarks"].items() for words in remarks]
    rows += [(f"{unit} remark", _told(remark)) for unit, remarks in summary["remarks"].items() for remark in remarks]
    width = max(len(name) for name, _ in rows)
    return "\n".join([f"{summary['scene']}: {title}", *(f"  {name:{width}}  {text}" for name, text in rows)])


def _told(remark: Mapping[str, Any]) -> str:
    """A remark of one kind: when and what first, how often, when and what last."""
    first = f"at {remark['first_s']:g} s: {remark['first']}"
    if remark["times"] == 1:
        return first
    last = "the same" if remark["last"] == remark["first"] else remark["last"]
    return f"{first}; {remark['times']} times, last at {remark['last_s']:g} s: {last}"
