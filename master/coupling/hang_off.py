"""What the master knows of pipe and vessel by name: the bond at the hang-off point."""

from __future__ import annotations

from .bond import Bond, Pair


def hang_off() -> Bond:
    """The bond of pipe and vessel: force with velocity, moment with angular velocity."""
    return Bond(
        (
            Pair("force", "velocity", 1e-6, end_effort="end_force", end_flow="end_velocity", met_flow="top_velocity"),
            Pair(
                "moment", "angular_velocity", 1e-8,
                end_effort="end_moment", end_flow="end_angular_velocity", met_flow="top_angular_velocity",
            ),
        )
    )
