"""Parameters of the vessel; the defaults are the supply vessel of the Marine Systems Simulator (MSS), about its centre of gravity.

Source of the numbers: MSS (MIT licence, T. I. Fossen and T. Perez), ShipX data of a supply vessel of 82.8 x 19.2 x 6 m
moved from its origin (midships, waterline) to the centre of gravity, which lies 5.39 m aft and 1.30 m above. Added mass
is A(0) in surge, sway and yaw and A at the natural frequency in heave, roll and pitch (A(infinity) belongs to the fluid
memory, which is not modelled). In sway and yaw A(0) follows from A and B at 0.21 rad/s and above: the first row of the
data, 0.105 rad/s, has half of it and contradicts all others. By Kramers-Kronig these give A_22(0) = 5.11e6 to 5.13e6 kg,
A_66(0) = 2.13e9 to 2.14e9 kg m2, A_26(0) = 1.60e7 to 1.62e7 kg m, and a passive model fitted to them the values used
here. The centre of flotation lies C_35 / C_33 = 5.08 m aft of the centre of gravity. With C_35 come A_35 and B_35 at
1 rad/s, near both natural frequencies: then heave and pitch have the periods 6.50 and 6.05 s, as with A and B at every
frequency; with C_35 alone they would have 7.10 and 5.62 s. A_15, A_24, A_46 are left out: they mix modes whose added
masses are taken at different frequencies. Linear damping is M_ii / T with T = 88, 45 and 12 s in surge, sway and yaw
(model of Fossen, Sagatun and Sorensen 1996) and B at the natural frequency in heave, roll and pitch, roll with 3.0e7
N m s viscous damping. Drag coefficients, thrust limits and times of the controller are engineering choices.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .attitude import Array
from .checks import check_fields, number
from .environment import Environment
from .rules import check, refused_added_mass, refused_damping, refused_limits, refused_ratio
from .vectors import numbers, vector

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class AddedMass:
    """Entries of the symmetric added-mass matrix of a hull with port-starboard symmetry, about the centre of gravity."""

    surge: float = number(8.463e5, "kg", "A_11", min=0.0)
    sway: float = number(5.15e6, "kg", "A_22", min=0.0)
    heave: float = number(7.898e6, "kg", "A_33", min=0.0)
    roll: float = number(8.8812e7, "kg.m2", "A_44", min=0.0)
    pitch: float = number(3.3572e9, "kg.m2", "A_55", min=0.0)
    yaw: float = number(2.15e9, "kg.m2", "A_66", min=0.0)
    surge_heave: float = number(0.0, "kg", "A_13 = A_31")
    surge_pitch: float = number(0.0, "kg.m", "A_15 = A_51")
    heave_pitch: float = number(5.294e7, "kg.m", "A_35 = A_53")
    sway_roll: float = number(0.0, "kg.m", "A_24 = A_42")
    sway_yaw: float = number(1.6e7, "kg.m", "A_26 = A_62")
    roll_yaw: float = number(0.0, "kg.m2", "A_46 = A_64")

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class LinearDamping:
    """Entries of the symmetric matrix of linear (potential and viscous) damping, about the centre of gravity."""

    surge: float = number(8.191e4, "N.s/m", "D_11", min=0.0)
    sway: float = number(2.558e5, "N.s/m", "D_22", min=0.0)
    heave: float = number(5.8222e6, "N.s/m", "D_33", min=0.0)
    roll: float = number(3.4467e7, "N.m.s", "D_44, viscous roll damping included", min=0.0)
    pitch: float = number(3.3615e9, "N.m.s", "D_55", min=0.0)
    yaw: float = number(4.063e8, "N.m.s", "D_66", min=0.0)
    surge_heave: float = number(0.0, "N.s/m", "D_13 = D_31")
    surge_pitch: float = number(0.0, "N.s", "D_15 = D_51")
    heave_pitch: float = number(5.798e7, "N.s", "D_35 = D_53")
    sway_roll: float = number(0.0, "N.s", "D_24 = D_42")
    sway_yaw: float = number(0.0, "N.s", "D_26 = D_62")
    roll_yaw: float = number(0.0, "N.m.s", "D_46 = D_64")

    def __post_init__(self) -> None:
        check_fields(self)
        check(refused_damping, vector(self), within="damping")


@dataclass(frozen=True)
class HullDrag:
    """Quadratic drag: surge resistance, and cross-flow on strips along the hull, which damps sway and yaw together."""

    length: float = number(82.8, "m", "length over which cross-flow acts", above=0.0)
    beam: float = number(19.2, "m", "beam, for the frontal area", above=0.0)
    draft: float = number(6.0, "m", "draft", above=0.0)
    midship: float = number(5.386, "m", "x of midships from the centre of gravity, positive forward")
    surge_coefficient: float = number(0.2, "1", "drag coefficient on beam x draft", min=0.0)
    cross_flow_coefficient: float = number(0.8, "1", "drag coefficient on length x draft", min=0.0)

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Controller:
    """Dynamic positioning: PID in surge, sway and yaw by pole placement, reference filter, feed-forward of the pipe's pull."""

    x: float | None = number(None, "m", "set-point x of the centre of gravity, in e; absent: where the vessel starts")
    y: float | None = number(None, "m", "set-point y of the centre of gravity, in e; absent: where the vessel starts")
    yaw: float | None = number(None, "rad", "set-point heading; absent: that of the start", min=-math.pi, max=math.pi)
    start: float = number(30.0, "s", "time at which the controller takes over from the hold thrust")
    period: float = number(0.5, "s", "sampling period", above=0.0)
    natural_frequency: float = number(0.1, "rad/s", "w_n of the closed loop, K_p = M w_n^2", above=0.0)
    damping_ratio: float = number(1.0, "1", "zeta of the closed loop, K_d = 2 zeta w_n M", above=0.0)
    integral_ratio: float = number(0.2, "1", "K_i = ratio w_n K_p", min=0.0)
    filter_time: float = number(20.0, "s", "time constant of the third-order reference filter", above=0.0)
    feed_forward_time: float = number(10.0, "s", "time constant of the low-pass on the pull that is fed forward", above=0.0)
    surge_limit: float = number(1.0e6, "N", "largest thrust in surge", above=0.0)
    sway_limit: float = number(0.6e6, "N", "largest thrust in sway", above=0.0)
    yaw_limit: float = number(2.0e7, "N.m", "largest thruster moment in yaw", above=0.0)

    def __post_init__(self) -> None:
        check_fields(self)
        check(refused_ratio, float(self.damping_ratio), float(self.integral_ratio), within="controller")


@dataclass(frozen=True)
class Start:
    """Pose and velocity at the start."""

    position: Vector3 = number((804.72, 0.0, -800.0), "m", "centre of gravity, in e")
    attitude: Vector3 = number((0.0, 0.0, 0.0), "rad", "roll, pitch, yaw (zyx)")
    velocity: Vector3 = number((0.0, 0.0, 0.0), "m/s", "surge, sway, heave velocity, in b")
    angular_velocity: Vector3 = number((0.0, 0.0, 0.0), "rad/s", "roll, pitch, yaw rate, in b")

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class VesselParameters:
    """The whole vessel; None for `damping`, `drag` or `controller` leaves that part out."""

    mass: float = number(6.3622e6, "kg", "mass m_V", above=0.0, usual=(1e5, 1e9))
    inertia: Vector3 = number((2.87307e8, 2.726143e9, 2.726143e9), "kg.m2", "roll, pitch, yaw inertia about the CG, in b", above=0.0)
    waterplane_area: float = number(1383.39, "m2", "A_wp", above=0.0, usual=(50.0, 1e5))
    metacentric_height: float = number(2.144, "m", "transverse GM_T", above=0.0)
    longitudinal_metacentric_height: float = number(97.866, "m", "longitudinal GM_L, of trim about flotation_centre", above=0.0)
    flotation_centre: float = number(-5.0846, "m", "x_F of the centre of flotation from the CG, positive forward: C_35 = -x_F C_33")
    hang_off: Vector3 = number((0.0, 0.0, 0.0), "m", "hang-off point r_t from the CG, in b", usual=(-300.0, 300.0))
    departure_angle: float = number(1.1760, "rad", "alpha of R_b^t = R_y(-alpha): pitch of the held pipe over the bow direction")
    departure_rotation: Vector3 = number((0.0, 0.0, 0.0), "rad", "rotation vector in b applied to the held section after alpha")
    hold_force: Vector3 = number((0.0, 0.0, 0.0), ("N", "N", "N.m"), "constant thrust until the controller starts: x, y in e, yaw moment")
    added_mass: AddedMass = field(default_factory=AddedMass)
    damping: LinearDamping | None = field(default_factory=LinearDamping)
    drag: HullDrag | None = field(default_factory=HullDrag)
    controller: Controller | None = field(default=None, metadata={"doc": "switches on dynamic positioning"})
    start: Start = field(default_factory=Start)
    environment: Environment = field(default_factory=Environment)

    def __post_init__(self) -> None:
        check_fields(self)
        check(refused_added_mass, float(self.mass), np.array(self.inertia, float), vector(self.added_mass))
        if (c := self.controller) is not None:
            limits = np.array([c.surge_limit, c.sway_limit, c.yaw_limit], float)
            check(refused_limits, np.array(self.hold_force, float), float(self.start.attitude[2]), limits)


def values(parameters: VesselParameters) -> Array:
    """All that the kernels know of a vessel: its numbers, then the factor of the current at the surface, which its profile has there."""
    sea = parameters.environment
    return np.append(vector(parameters), np.nan if sea.current is None else sea.current.shape(sea.depth)[1][0])


NAMES = tuple(it.name for it in numbers(VesselParameters, None))
SURFACE_FACTOR = len(NAMES)  # place in the values


def place(name: str) -> Any:
    """Where in the values a number is, or the slice that a table or a fixed tuple takes."""
    if name in NAMES:
        return NAMES.index(name)
    inside = [i for i, one in enumerate(NAMES) if one.startswith((f"{name}.", f"{name}["))]
    return slice(inside[0], inside[-1] + 1)
