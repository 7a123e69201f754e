"""The identification as text: one table, what is identifiable, and warnings."""

from collections.abc import Iterator

from wam_analysis.identification.fit import Identification
from wam_analysis.identification.overlay import identified
from wam_analysis.table import plain
from wam_analysis.thresholds import IDENTIFY
from wam_description.arm import Shared

UNITS = {
    "coulomb": "N m", "static": "N m", "load": "", "viscous": "N m s/rad", "stribeck": "rad/s", "inertia": "kg m^2",
    "mass": "kg", "moment": "kg m", "torque": "",
}  # fmt: skip
CURVE = ("motors.static_", "motors.stribeck_")
BY_SHAPE = "by the curve"
NOTES = f"""'In combination': identified only together with other parameters.
'{BY_SHAPE}': static friction is the value of the fitted friction curve at rest, the Stribeck velocity where it drops,
each with the error of that curve. Stiction that acts only below {IDENTIFY.slowest_motor:g} rad/s of a motor is not in
it; `wam analyse` shows breakaway torques.
The inertia of a rotor may be wrong by a quarter of it, which is within two of its standard errors: see
docs/identify.md.
Friction of a joint with a motor of its own is part of that motor's friction.
A torque offset is not identifiable from this recording: it gives the same torques as friction that differs between the
directions, in motion, at rest and with a dither. The table shows the offset that would explain the whole difference.
The model has the sum of friction and offset, in coulomb_positive and coulomb_negative.
'not in the covariance': the part of the torque error, one standard deviation, that the covariance for the contact
estimator cannot express."""


def report(shared: Shared, found: Identification, label: str) -> str:
    """Table, fit and warnings.

    Parameters
    ----------
    label : of the recording.
    """
    result = identified(found)
    rows = []
    is_identified, is_combined = found.is_identified, found.is_combined  # each of them computes the covariance
    for i, name in enumerate(found.unknowns.names):
        unit = UNITS[name.split(".")[1].partition("_")[0]]
        state = "yes" if is_identified[i] else "in combination" if is_combined[i] else "no"
        state = BY_SHAPE if state == "yes" and name.startswith(CURVE) else state
        cells = [f"{each[i]:.4g}" for each in result]
        rows.append([name, *cells, unit, state])
    offset, offset_sd = found.offset_if_alike
    for i, name in enumerate(shared.arm.motors.names):
        numbers = [f"{offset[i]:.4g}", f"{offset_sd[i]:.4g}", "0"]
        rows.append([f"motors.torque_offset.{name}", *numbers, "N m", "not from this recording"])
    head = [["parameter", "value", "standard error", "present value", "unit", "identifiable"]]
    lines = [f"{label}: model of the arm from free motion", "", *plain(head, rows, left=(0, 4, 5)), ""]
    parts = (found.before, found.residual, found.held_out, found.tracked.left)
    lines += plain(
        [
            [
                "motor",
                "motion",
                "torque unexplained by the present model",
                "by the identified model",
                "by it, in motion not used for the fit",
                "not in the covariance",
            ]
        ],
        [
            [name, f"{found.seconds[i]:.1f} s", *(f"{1e3 * rms[i]:.3g} mN m" for rms in parts)]
            for i, name in enumerate(shared.arm.motors.names)
        ],
    )
    lines += ["", NOTES]
    return "\n".join([*lines, *(f"warning: {text}" for text in warnings(shared, found)), ""])


def warnings(shared: Shared, found: Identification) -> Iterator[str]:
    """What the recording is too short or too slow for, and where the model does not fit."""
    for i, name in enumerate(shared.arm.motors.names):
        if found.seconds[i] < IDENTIFY.short:
            yield f"{name} turns freely for {found.seconds[i]:.1f} s only; record {IDENTIFY.short:g} s or more"
        if found.both_directions[i] < IDENTIFY.few_parts:
            yield (
                f"{name} turns in both directions in only {found.both_directions[i]} of the {IDENTIFY.parts} equal "
                "sections of the recording, so its standard errors are uncertain; let it reverse more"
            )
        if found.held_out[i] > IDENTIFY.unexplained * found.residual[i] + 1e-4:
            yield (
                f"{name}: in motion not used for the fit, {1e3 * found.held_out[i]:.3g} mN m remain unexplained, in "
                f"the rest {1e3 * found.residual[i]:.3g} mN m; record more motion"
            )
        if (share := found.unexplained[i]) > IDENTIFY.remaining:
            yield (
                f"{name}: {1e3 * found.residual[i]:.3g} mN m remain unexplained, {share:.0%} of its friction: "
                "was the motion free of contact?"
            )
