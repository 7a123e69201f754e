"""Every constant of the MIT/WAM arm and of the testbed: as printed, or assumed with the reason.

These numbers are only here and, in SI units, in ``config/``; a test compares the two.  `erratum` explains
corrections of printed numbers.
"""

import math
from dataclasses import dataclass
from typing import Literal

from wam_description.units import si


@dataclass(frozen=True)
class Constant:
    """One row of the table.

    Attributes
    ----------
    symbol : the thesis's letter, or the closest one.
    meaning : the quantity and its part.
    value : number or numbers in `unit`, as printed; corrected if `erratum` gives the printed one.
    unit : unit as printed, a key of `units.FACTORS`.
    mark : 'thesis' if printed or computed from printed numbers alone, otherwise 'assumed'.
    source : section, table or equation; empty if not printed.
    parameter : dotted name in ``config/`` with this value; empty if there is none.
    index : elements of the parameter that it covers; empty for all.
    reason : for this value, if it is assumed.
    erratum : what is wrong in print; empty if nothing is.
    """

    symbol: str
    meaning: str
    value: float | tuple[float, ...]
    unit: str
    mark: Literal["thesis", "assumed"]
    source: str
    parameter: str
    index: tuple[int, ...]
    reason: str
    erratum: str

    @property
    def si(self) -> tuple[float, ...]:
        """The value or values in SI units."""
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        return tuple(si(value, self.unit) for value in values)


def _printed(
    symbol: str,
    meaning: str,
    value: float | tuple[float, ...],
    unit: str,
    source: str,
    *,
    parameter: str = "",
    index: tuple[int, ...] = (),
    erratum: str = "",
) -> Constant:
    return Constant(symbol, meaning, value, unit, "thesis", source, parameter, index, reason="", erratum=erratum)


def _assumed(
    symbol: str,
    meaning: str,
    value: float | tuple[float, ...],
    unit: str,
    reason: str,
    *,
    parameter: str = "",
    index: tuple[int, ...] = (),
) -> Constant:
    return Constant(symbol, meaning, value, unit, "assumed", "", parameter, index, reason=reason, erratum="")


L3, L4, ASIDE = 22.0, 16.0, 1.6  # in
PEAK = 43.0  # in-lb
N1, N2, N4 = 29.97, 30.40, 19.15
FRICTION = (0.014, 0.01, 0.01, 0.01)  # of peak torque
MOTOR_FRACTION = 0.75
DYNAMIC = 0.9
JOINT_RATIO = (N1, 2.0 * N2, N2, N4)  # largest joint torque per motor torque, (A.5) by power

_MOTOR_STATIC = tuple(MOTOR_FRACTION * friction * PEAK for friction in FRICTION)
_JOINT_STATIC = tuple(
    (1.0 - MOTOR_FRACTION) * friction * ratio * PEAK for friction, ratio in zip(FRICTION, JOINT_RATIO, strict=True)
)
_MOTOR_FRICTION = "the joint friction of 7.2.2, 75 % of it at the motor ('the major source is at each motor')"
_JOINT_FRICTION = "the 25 % of 7.2.2 that is not at the motor; joint peak is the motors' through (A.5)"
_LINKS = "not printed; estimate that meets 7.2.2: 10 lb at any point in any pose takes 12.7 of 15 in-lb"

# fmt: off
# two equal reductions of each circuit, and the free length of the slow one that leaves this k_tr in all
_STAGE = tuple(math.sqrt(n) for n in (N1, N2, N2, N4))
_SLOW_LENGTH = tuple(
    2.0 * 9500.0 * 0.375**2 / root * (si(1.0, "lb-in/rad") / k - span / (2.0 * 9500.0 * 0.375**2))
    for root, k, span in zip(_STAGE, (34.0, 34.0, 34.0, 11.8), (8.0, 8.0, 8.0, 22.0), strict=True)
)
_TESTBED_K = 2.0 * 262.0 * 0.375**2  # lb-in/rad

ARM_PRINTED: tuple[Constant, ...] = (
    # 7.2.1 kinematics and geometry
    _printed("L3, L4", "lengths of inner and outer link", (L3, L4), "in", "7.2.1, App. A",
        parameter="arm.covers.length"),
    _printed("", "range of joint 1, 2, 3", (350.0, 270.0, 300.0), "deg", "7.2.1"),
    _printed("", "aspect ratio of the inner link", 5.0, "1", "7.2.1"),
    _printed("", "hole through which the joint-4 mechanism fits", 4.4, "in", "7.2.1"),
    _printed("", "aspect ratio of the outer link", 9.0, "1", "7.2.1"),
    _printed("", "length of the outer tube", 18.0, "in", "7.2.1",
        erratum="18 in is the tube, 16 in from axis to tip"),
    _printed("", "diameter of the outer tube", 2.0, "in", "7.2.1"),
    _printed("", "radius of the outer tube", 2.0 / 2.0, "in", "7.2.1, half of 2 in",
        parameter="arm.covers.radius", index=(1,)),
    # 7.2.2 motors: Moog 300-003, identical
    _printed("J_m", "rotor inertia with resolver", 0.00036, "lb-in-s^2", "7.2.2",
        parameter="arm.motors.inertia"),
    _printed("", "weight of a framed motor", 3.5, "lbm", "7.2.2"),
    _printed("", "steady torque at stall", 15.0, "in-lb", "7.2.2", parameter="arm.motors.continuous_torque"),
    _printed("", "peak torque at stall", PEAK, "in-lb", "7.2.2", parameter="arm.motors.peak_torque"),
    _printed("", "magnet poles", 8.0, "1", "7.2.2"),
    _printed("", "phases of the winding", 3.0, "1", "7.2.2"),
    _printed("F", "steady contact force at any point, any pose", 10.0, "lb", "7.2.2"),
    # 7.2.2 transmissions
    _printed("", "joint friction, of peak torque; 2 to 4 are bounds", (1.4, 1.0, 1.0, 1.0), "%", "7.2.2"),
    _printed("N", "nominal reduction of joints 1 to 4", (30.0, 30.0, 30.0, 20.0), "1", "7.2.2"),
    _printed("eta", "least limiting efficiency at full torque", 96.0, "%", "7.2.2"),
    _printed("", "payload at the tip for which the ratios were chosen", 2.0, "kg", "7.2.2"),
    _printed("EA", "stiffness per length of the differential's cable", 51500.0, "lb", "7.2.2"),
    _printed("", "free cable in the differential", 0.0, "in", "7.2.2"),
    _printed("", "span of the joint-4 cable circuit", 22.0, "in", "7.2.2"),
    _printed("", "largest twist of the joint-4 circuit, each way", 180.0, "deg", "7.2.2"),
    # Appendix A
    _printed("alpha_(i-1)", "link twist", (0.0, math.pi / 2, -math.pi / 2, math.pi / 2), "rad", "App. A",
        parameter="arm.joints.twist"),
    _printed("a_(i-1)", "link length", (0.0, 0.0, 0.0, 0.0), "in", "App. A", parameter="arm.joints.length",
        erratum="7.2.1: axes 3 and 4 do not meet; with a3 = 0 they do, only the tube is offset"),
    _printed("d_i", "link offset", (0.0, 0.0, L3, 0.0), "in", "App. A", parameter="arm.joints.offset"),
    _printed("a_4", "frame 5 in frame 4", (L4, 0.0, 0.0), "in", "App. A", parameter="arm.tool"),
    _printed("", "angle of the inner tube to the kinematic link", 0.0726, "rad", "App. A, footnote"),
    _printed("", "far ends of the tubes, along and aside", (L3, ASIDE, L4), "in", "App. A",
        parameter="arm.covers.end", index=(0, 2, 3)),
    _printed("theta", "pose of figure A.1", (0.0, 0.0, 0.0, 0.0), "rad", "(A.1)"),
    _printed("theta", "pose in the middle of the workspace", (0.0, -math.pi / 4, 0.0, 0.0), "rad", "(A.2)"),
    _printed("theta", "pose with both links stretched out horizontally",
        (0.0, -math.pi / 2, 0.0, math.pi / 2), "rad", "(A.3)",
        erratum="printed (0, -pi/4, 0, 0), which is (A.2); the tip is at (38, 0, 0) in"),
    _printed("N1..N4", "transmission ratios", (N1, N2, N2 / 2.0, N4), "1", "(A.6)",
        erratum="printed 30.40_2 in the scan, which is 30.40/2: the differential is 2:1"),
    _printed("M", "joint angles of motor angles, row by row",
        (1.0 / N1, 0.0, 0.0, 0.0,
         0.0, -1.0 / (2.0 * N2), 1.0 / (2.0 * N2), 0.0,
         0.0, -1.0 / N2, -1.0 / N2, 0.0,
         0.0, 0.0, 0.0, 1.0 / N4),
        "1", "(A.5), (A.6)", parameter="arm.joint_from_motor"),
)

ARM_ASSUMED: tuple[Constant, ...] = (
    _assumed("k_t", "torque constant", 0.25, "N m/A",
        "none is printed; it puts the peak torque at 19 A, the size of a servo amplifier of the time",
        parameter="arm.motors.torque_constant"),
    _assumed("", "fraction of the friction at the motor", MOTOR_FRACTION, "1",
        "7.2.2 states 'major'; 70 to 80 %"),
    _assumed("F_d/F_s", "dynamic over static friction", DYNAMIC, "1",
        "not printed; low-stiction cable drive"),
    _assumed("F_s", "static friction, motor", _MOTOR_STATIC, "in-lb", _MOTOR_FRICTION,
        parameter="arm.motors.static_friction"),
    _assumed("F_d", "dynamic friction, motor", tuple(DYNAMIC * torque for torque in _MOTOR_STATIC), "in-lb",
        "0.9 of static friction", parameter="arm.motors.dynamic_friction"),
    _assumed("b_m", "viscous friction, motor", 1e-4, "N m s/rad",
        "not printed; under a tenth of Coulomb friction at 1 rad/s of the joint",
        parameter="arm.motors.viscous_friction"),
    _assumed("EA", "cables of the fast stages", 9500.0, "lb", "none is printed for the arm; the cable of 6.4.5",
        parameter="arm.cables.stage_ea", index=(0, 2, 4, 6)),
    _assumed("EA", "cables of the slow stages", tuple(9500.0 * root for root in _STAGE), "lb",
        "7.2.2: scaled so that the cables of each stage have the same stress; two equal reductions",
        parameter="arm.cables.stage_ea", index=(1, 3, 5, 7)),
    _assumed("L", "free length of the fast stages", (8.0, 8.0, 8.0, 22.0), "in",
        "joint 4 spans the inner link (7.2.2); the others are in the base",
        parameter="arm.cables.stage_length", index=(0, 2, 4, 6)),
    _assumed("L", "effective free length of the slow stages", _SLOW_LENGTH, "in",
        "7.2.2: 'very close to zero'; the cable on the pulleys is elastic too: k_tr becomes 34 and 11.8 N m/rad; "
        "the fast stages alone have 37.7 and 13.7", parameter="arm.cables.stage_length", index=(1, 3, 5, 7)),
    _assumed("r", "radius of the pinions", 0.375, "in", "not printed; that of the testbed",
        parameter="arm.cables.stage_radius"),
    _assumed("", "parallel circuits", 1.0, "1", "what runs in parallel is in EA",
        parameter="arm.cables.stage_circuits"),
    _assumed("n", "motor turns per turn of the stage's pinion",
        (1.0, _STAGE[0], 1.0, _STAGE[1], 1.0, _STAGE[2], 1.0, _STAGE[3]), "1", "two equal reductions",
        parameter="arm.cables.stage_ratio"),
    _assumed("", "breaking strength of a fast cable", 170.0, "lb", "not printed; the cable of 6.4.5",
        parameter="arm.cables.breaking_strength"),
    _assumed("b_tr", "damping of the cable circuits, at the motor", (3.72e-3, 3.72e-3, 3.72e-3, 2.19e-3),
        "N m s/rad", "not printed; 5 % of critical against the rotor, as for the joint of the testbed",
        parameter="arm.cables.damping"),
    _assumed("T_0", "pretension", 57.0, "lb",
        "6.5: half of the full-torque tension, 43 in-lb on 0.375 in radius", parameter="arm.cables.pretension"),
    _assumed("J", "inertia of the pulleys that turn with each joint", (0.008, 0.017, 0.004, 0.0017), "kg m^2",
        "no pulley is printed; estimate for the two-stage reductions and the differential",
        parameter="arm.joints.armature"),
    _assumed("F_s", "static friction, joint", _JOINT_STATIC, "in-lb", _JOINT_FRICTION,
        parameter="arm.joints.static_friction"),
    _assumed("F_d", "dynamic friction, joint", tuple(DYNAMIC * torque for torque in _JOINT_STATIC), "in-lb",
        "0.9 of static friction", parameter="arm.joints.dynamic_friction"),
    _assumed("b_l", "viscous friction, joint", 0.05, "N m s/rad",
        "not printed; under a quarter of Coulomb friction at 1 rad/s",
        parameter="arm.joints.viscous_friction"),
    _assumed("", "lower stops", (-350.0 / 2.0, -270.0 / 2.0, -300.0 / 2.0, -90.0), "deg",
        "ranges of 7.2.1 with their middle at zero; joint 4 to a right angle, where the tubes overlap "
        "by 23 to 52 mm; world.folding stops them before",
        parameter="arm.joints.lower"),
    _assumed("", "upper stops", (350.0 / 2.0, 270.0 / 2.0, 300.0 / 2.0, 140.0), "deg",
        "ranges of 7.2.1 with their middle at zero; joint 4 is read off no drawing: 50 deg beyond straight",
        parameter="arm.joints.upper"),
    _assumed("theta", "pose at power-up", (0.0, -0.6, 0.0, 0.5), "rad",
        "near (A.2), far from stops and singular poses", parameter="arm.joints.start"),
    _assumed("", "joint speeds above which there is a fault", (4.0, 4.0, 6.0, 6.0), "rad/s",
        "none is printed; above the 2.5 rad/s up to which contacts must be detected",
        parameter="arm.joints.speed_limit"),
    _assumed("m", "masses of the links", (7.68, 3.59, 1.95, 1.06), "kg", _LINKS, parameter="arm.links.mass"),
    _assumed("", "centres of mass of links 1, 2 and 4, in their frames",
        (0.0, 0.0, -0.029, 0.0, -0.027, 0.022, 0.136, 0.0, 0.0), "m", _LINKS, parameter="arm.links.centre",
        index=(0, 1, 2, 3, 4, 5, 9, 10, 11)),
    _assumed("", "centre of mass of link 3; 0.331 m from the shoulder, frame 3 is at the elbow",
        (-0.011, 0.0, 0.331 - 0.5588), "m", _LINKS, parameter="arm.links.centre", index=(6, 7, 8)),
    _assumed("I", "principal inertia of the links about their centres",
        (0.068, 0.036, 0.063, 0.013, 0.010, 0.009, 0.094, 0.094, 0.0019, 0.0007, 0.0205, 0.0205), "kg m^2",
        _LINKS, parameter="arm.links.inertia"),
    _assumed("I_xy", "products of inertia of the links", 0.0, "kg m^2", "the axes of the links are taken as principal",
        parameter="arm.links.product"),
    _assumed("", "origins of the covers' frames", (0.0, 0.0, -L3, 0.0, 0.0, 0.0), "in",
        "convention: positions count from the shoulder and from the elbow, as x in (2.2)",
        parameter="arm.covers.origin"),
    _assumed("", "rotation of the covers' frames", (0.0, -90.0, 0.0, 0.0, 0.0, 0.0), "deg",
        "convention: x along the kinematic link; z of the inner cover away from the outer link",
        parameter="arm.covers.rotation"),
    _assumed("", "near ends of the tubes", 0.0, "in",
        "1.6 in at 22 in is 0.0726 rad, so that the inner tube starts on the axis; the outer is drawn on it",
        parameter="arm.covers.start"),
    _assumed("", "far ends of the tubes, other side", 0.0, "in", "as drawn in A.1",
        parameter="arm.covers.end", index=(1, 4, 5)),
    _assumed("", "radius of the inner tube", 1.5, "in",
        "not printed; 3 in of tube below the 4.4 in of the joint-4 mechanism", parameter="arm.covers.radius",
        index=(0,)),
    _assumed("", "payload at the tool", 0.0, "kg", "nothing is carried", parameter="arm.payload"),
    _assumed("g", "gravity, base upright", (0.0, 0.0, -9.80665), "m/s^2",
        "standard gravity; 7.2.1 has axis 1 vertical", parameter="arm.gravity"),
)

TESTBED: tuple[Constant, ...] = (
    # 4.3.2: Moog 303-003
    _printed("J_m", "rotor inertia, testbed", 0.0057, "oz-in-s^2", "4.3.2", parameter="arm.motors.inertia"),
    _printed("", "pinion diameter", 0.75, "in", "4.3.2, 6.4.5"),
    _printed("", "cable diameter", 0.044, "in", "4.3.2, 6.4.5"),
    _printed("", "span of the cable circuit", 36.0, "in", "4.3.2", erratum="6.4.5 calls it 1 m"),
    _printed("EA/L", "stiffness of each half of the circuit", 262.0, "lb/in", "4.3.2"),
    _printed("N", "transmission ratio", 14.0, "1", "4.3.2, 6.4.5", erratum="(2.9/0.75)^2 = 14.95"),
    _printed("1/N", "joint angle of motor angle", 1.0 / 14.0, "1", "4.3.2", parameter="arm.joint_from_motor"),
    _printed("L", "free length of the fast stage, EA over the stiffness of a half", 9500.0 / 262.0, "in",
        "4.3.2, 6.4.5", parameter="arm.cables.stage_length", index=(0,)),
    _printed("r", "radius of the pinions", 0.375, "in", "4.3.2, 6.4.5", parameter="arm.cables.stage_radius"),
    _printed("N_m", "matching transmission ratio", 104.0, "1", "4.3.2", erratum="sqrt(J_l/J_m) = 105.96"),
    _printed("L", "length of the link", 36.0, "in", "4.3.2", parameter="arm.covers.length"),
    _printed("L", "the tip", (36.0, 0.0, 0.0), "in", "4.3.2", parameter="arm.tool"),
    _printed("L", "far end of the link", (36.0, 0.0, 0.0), "in", "4.3.2", parameter="arm.covers.end"),
    _printed("J_l", "inertia of the link", 64.0, "oz-in-s^2", "4.3.2"),
    _printed("k_c", "best contact stiffness, at the joint", 9e5, "lb-in/rad", "4.3.2",
        erratum="(4.9) gives 8.27e5; 9e5 is where omega1 reaches 95.4 % of its asymptote"),
    _printed("k_c", "the same at the tip", 650.0, "lb/in", "4.3.2", erratum="(4.9) gives 638 lb/in at 36 in"),
    # 5.6
    _printed("F_f", "joint friction, of peak torque; a bound", 1.0, "%", "5.6"),
    _printed("k_c", "spring below the tip", 10.0, "lb/in", "5.6"),
    _printed("", "rate of the force loop", 50.0, "Hz", "5.6"),
    _printed("F_des", "step in force", 10.0, "lb", "5.6"),
    _printed("", "step back from the marginal gain", 10.0, "%", "5.6"),
    # 6.4.5
    _printed("", "distance from motor to joint", 1.0, "m", "6.4.5",
        erratum="the cable circuit of 4.3.2 spans 36 in"),
    _printed("", "least breaking strength of the cable", 170.0, "lb", "6.4.5",
        parameter="arm.cables.breaking_strength"),
    _printed("", "diameter of the driven pulley", 2.9, "in", "6.4.5"),
    _printed("EA", "stiffness per length of the cable, measured", 9500.0, "lb", "6.4.5",
        parameter="arm.cables.stage_ea", index=(0,)),
    _printed("", "peak torque, Moog 303-003", 60.0, "in-lb", "6.4.5", parameter="arm.motors.peak_torque"),
    _printed("eta", "limiting efficiency of two stages, one stage", (0.966, 0.983), "1", "6.4.5"),
    _printed("", "driven pulley of a single stage", 11.2, "in", "6.4.5"),
    _printed("", "width of the manipulator", 2.0, "in", "6.4.5"),
    # assumed
    _assumed("k_tr", "cable stiffness, at the motor", 2.0 * 262.0 * 0.375**2, "lb-in/rad",
        "not printed; both strands on the pinion's radius, 2 (EA/L) r^2, give the 638 lb/in of (4.9)"),
    _assumed("zeta", "damping ratio at the joint", 0.05, "1",
        "5.6 gives none, only 'particularly low'"),
    _assumed("b", "viscous friction of the joint", 2.0 * 0.05 * math.sqrt(4.0 * (14.0**2 * _TESTBED_K + 12960.0)),
        "lb-in-s/rad", "damping ratio 0.05 against link, cable and spring, 2 zeta sqrt(J_l (k_tr + k_c))",
        parameter="arm.joints.viscous_friction"),
    _assumed("b_tr", "damping of the cable circuit, at the motor", 1.83e-3, "N m s/rad",
        "not printed; 5 % of critical against the rotor", parameter="arm.cables.damping"),
    _assumed("k_t", "torque constant", 0.25, "N m/A", "none is printed; as the arm's motors",
        parameter="arm.motors.torque_constant"),
    _assumed("", "continuous torque", 15.0, "in-lb", "not printed; as the arm's motors, same rotor",
        parameter="arm.motors.continuous_torque"),
    _assumed("F_s", "static friction, motor", 0.75 * 0.008 * 60.0, "in-lb",
        "5.6: below 1 % of peak torque; 0.8 % taken, three quarters of it at the motor",
        parameter="arm.motors.static_friction"),
    _assumed("F_d", "dynamic friction, motor", DYNAMIC * 0.75 * 0.008 * 60.0, "in-lb", "0.9 of static friction",
        parameter="arm.motors.dynamic_friction"),
    _assumed("b_m", "viscous friction, motor", 1e-4, "N m s/rad", "as the arm's motors",
        parameter="arm.motors.viscous_friction"),
    _assumed("F_s", "static friction, joint", 0.25 * 0.008 * 60.0 * 14.0, "in-lb", "the last quarter of 0.8 %",
        parameter="arm.joints.static_friction"),
    _assumed("F_d", "dynamic friction, joint", DYNAMIC * 0.25 * 0.008 * 60.0 * 14.0, "in-lb",
        "0.9 of static friction", parameter="arm.joints.dynamic_friction"),
    _assumed("T_0", "pretension", 80.0, "lb", "6.5: half of the full-torque tension, 60 in-lb on 0.375 in radius",
        parameter="arm.cables.pretension"),
    _assumed("EA", "cables of the slow stage", 9500.0 * math.sqrt(14.0), "lb", "same stress as the fast stage",
        parameter="arm.cables.stage_ea", index=(1,)),
    _assumed("L", "free length of the slow stage", 0.0, "in",
        "at the joint, several cables in parallel; k_tr of the fast stage alone gives the 638 lb/in of (4.9)",
        parameter="arm.cables.stage_length", index=(1,)),
    _assumed("", "parallel circuits", 1.0, "1", "what runs in parallel is in EA",
        parameter="arm.cables.stage_circuits"),
    _assumed("n", "motor turns per turn of the stage's pinion", (1.0, math.sqrt(14.0)), "1", "two equal reductions",
        parameter="arm.cables.stage_ratio"),
    _assumed("m", "mass of the link", 3.0 * 4.0 / 36.0**2, "lb-s^2/in", "a uniform rod of this J_l about its end",
        parameter="arm.links.mass"),
    _assumed("", "centre of mass of the link", (18.0, 0.0, 0.0), "in", "a uniform rod", parameter="arm.links.centre"),
    _assumed("I", "inertia of the link about its centre", (1e-4, 0.4519393 / 4.0, 0.4519393 / 4.0), "kg m^2",
        "a uniform rod: J_l/4; about its axis next to nothing", parameter="arm.links.inertia"),
    _assumed("I_xy", "products of inertia of the link", 0.0, "kg m^2", "a uniform rod",
        parameter="arm.links.product"),
    _assumed("J", "inertia of pulleys at the joint", 0.0, "kg m^2", "part of the link's 64 oz-in-s^2",
        parameter="arm.joints.armature"),
    _assumed("", "axis of the joint", math.pi / 2, "rad", "convention: horizontal axis, positive angles lift the link",
        parameter="arm.joints.twist"),
    _assumed("", "joint on the base's origin", 0.0, "in", "convention", parameter="arm.joints.length"),
    _assumed("", "joint on the base's origin, along the axis", 0.0, "in", "convention", parameter="arm.joints.offset"),
    _assumed("", "lower stop", -0.7, "rad", "not printed; far from what a spring is pressed",
        parameter="arm.joints.lower"),
    _assumed("", "upper stop", 0.7, "rad", "not printed; as the lower one", parameter="arm.joints.upper"),
    _assumed("", "angle at power-up", 0.0, "rad", "5.6: the link lies horizontally", parameter="arm.joints.start"),
    _assumed("", "joint speed above which there is a fault", 20.0, "rad/s",
        "far above any motion of 5.6, so that an instability can be watched", parameter="arm.joints.speed_limit"),
    _assumed("", "frame of the cover", (0.0, 0.0, 0.0), "in", "convention: that of the link",
        parameter="arm.covers.origin"),
    _assumed("", "rotation of the cover's frame", (0.0, 0.0, 0.0), "rad", "convention: x along the link",
        parameter="arm.covers.rotation"),
    _assumed("", "near end of the link", (0.0, 0.0, 0.0), "in", "drawn from the axis", parameter="arm.covers.start"),
    _assumed("", "radius of the link", 1.0, "in", "6.4.5: the manipulator is 2 in wide", parameter="arm.covers.radius"),
    _assumed("", "payload at the tool", 0.0, "kg", "nothing is carried", parameter="arm.payload"),
    _assumed("g", "gravity, base upright", (0.0, 0.0, -9.80665), "m/s^2", "standard gravity", parameter="arm.gravity"),
)
# fmt: on

CONSTANTS: tuple[Constant, ...] = ARM_PRINTED + ARM_ASSUMED + TESTBED
