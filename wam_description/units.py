"""Conversion of units; everywhere else values are in SI units and radians.

The factors rest on five exact definitions: inch, pound (mass), standard gravity, ounce and degree.
In the thesis 'lb' and 'oz' are forces, except in the weight of a motor; that mass is 'lbm' here.
"""

import math

INCH = 0.0254
POUND_MASS = 0.45359237
STANDARD_GRAVITY = 9.80665
POUND = POUND_MASS * STANDARD_GRAVITY
OUNCE = POUND / 16.0

FACTORS: dict[str, float] = {
    "1": 1.0,
    "%": 0.01,
    "m": 1.0,
    "m/s^2": 1.0,
    "kg": 1.0,
    "kg m^2": 1.0,
    "N m": 1.0,
    "N m/A": 1.0,
    "N m/rad": 1.0,
    "N m s/rad": 1.0,
    "rad": 1.0,
    "rad/s": 1.0,
    "Hz": 1.0,
    "deg": math.pi / 180.0,
    "in": INCH,
    "lbm": POUND_MASS,
    "lb": POUND,
    "lb/in": POUND / INCH,
    "in-lb": POUND * INCH,
    "lb-in": POUND * INCH,
    "lb-in/rad": POUND * INCH,
    "lb-in-s/rad": POUND * INCH,
    "lb-s^2/in": POUND / INCH,
    "lb-in-s^2": POUND * INCH,
    "oz-in-s^2": OUNCE * INCH,
}


def si(value: float, unit: str) -> float:
    """A value in its SI unit (m, kg, s, N, rad and products of them).

    Parameters
    ----------
    value : number in `unit`.
    unit : one of the keys of `FACTORS`.

    Raises
    ------
    ValueError
        if the unit is not known.
    """
    if unit not in FACTORS:
        raise ValueError(f"unit '{unit}' is not known; known units: {', '.join(sorted(FACTORS))}")
    return value * FACTORS[unit]
