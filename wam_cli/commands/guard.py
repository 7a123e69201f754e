"""`wam guard`: the force loop of an arm, or your own, assessed by the stability guard."""

import argparse
import math

from wam_cli.options import BASE_CONFIGURATION, PICTURE, bounded, configuration_of, take_configuration
from wam_control.task.scenario import FORCE_LOOP
from wam_description.interface import require_parameters
from wam_stack import guard
from wam_theory.loop_design import loop_design
from wam_theory.stick_slip import FrictionNode, IntegralLoop
from wam_theory.thresholds import DESIGN

PLANT = {  # option: what it is
    "inertia": "inertia of the driven link, kg m^2 or kg",
    "damping": "viscous damping, N m s/rad or N s/m",
    "transmission": "stiffness k_tr of the transmission, N m/rad or N/m",
    "contact": "stiffness k_c of the stiffest surface, N m/rad or N/m",
    "friction": "dynamic (Coulomb) friction, N m or N",
    "gain": "integral gain G_I, rad/s per N m or m/s per N",
}
FROM_ZERO, ABOVE_ZERO = bounded(float), bounded(float, 1.0 / DESIGN.absurd)
SERVO = "velocity_loop"
LEFT_OUT = ("margin here", "pose of margin here", "gains multiplied by", "lowered", "domain", "gains")  # in the message


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam guard` to its parser."""
    take_configuration(parser, default=None)
    parser.epilog = f"Without options: the packaged arm, {BASE_CONFIGURATION}."
    own = parser.add_argument_group(
        "for a force loop of your own", "the first six are needed, all for a rotary or all for a linear loop:"
    )
    for name, text in PLANT.items():
        own.add_argument(f"--{name}", type=FROM_ZERO if name in ("damping", "friction") else ABOVE_ZERO, help=text)
    own.add_argument("--stiction", type=FROM_ZERO, help="static friction, N m or N; default: the dynamic friction")
    own.add_argument(
        "--limit",
        type=ABOVE_ZERO,
        default=math.inf,
        help="bound of the force error (saturation), N m or N; default: none",
    )
    own.add_argument("--rate", type=FROM_ZERO, default=0.0, help="sampling rate, Hz; default: 0, a continuous loop")
    own.add_argument("--delay", type=FROM_ZERO, default=0.0, help="delay from sample to command, s; default: 0")
    own.add_argument(
        "--picture", type=PICTURE, help="draw the loop and the bound of stability into this PNG, PDF or SVG"
    )


def run(given: argparse.Namespace) -> int:
    """Assess the force loop of a configuration as at its start, or a loop of your own; 1 where it is not safe.

    Raises
    ------
    ValueError
        for options of a loop of your own and of a configuration together, and a picture without a loop.
    """
    if any(getattr(given, name) is not None for name in PLANT):
        if given.config or given.values:
            raise ValueError(f"--{', --'.join(PLANT)} describe a loop of your own; leave out --config and --set")
        return _assess(given)
    if given.picture:
        raise ValueError(f"--picture shows a loop of your own; give --{', --'.join(PLANT)}")
    given.config = given.config or BASE_CONFIGURATION
    configuration = configuration_of(given)
    require_parameters(configuration)
    report = guard(configuration)
    facts = {name: value for name, value in report.facts.items() if name not in LEFT_OUT}
    width = max(map(len, facts))
    absent = {SERVO, FORCE_LOOP}.difference(configuration.shared.nodes)
    if absent and "domain" in report.facts:
        print(f"computed for the packaged {' and '.join(sorted(absent))}, which this configuration does not run")
    print("\n".join([report.message, *(f"  {name:{width}}  {value}" for name, value in facts.items())]))
    return int(report.is_warning)


def _assess(given: argparse.Namespace) -> int:
    if missing := [name for name in PLANT if getattr(given, name) is None]:
        raise ValueError(
            f"--{missing[0]} is missing ({PLANT[missing[0]]}); give all of --{', --'.join(PLANT)}; 'wam analyse' "
            "gives inertia, damping and friction of a recorded joint"
        )
    *plant, gain = (getattr(given, name) for name in PLANT)
    stiction = given.friction if given.stiction is None else given.stiction
    if stiction < given.friction:
        raise ValueError(f"--stiction is {stiction:g}; give {given.friction:g}, the --friction, or more")
    loop = IntegralLoop(gain, error_limit=given.limit)
    design = loop_design(FrictionNode(*(*plant, stiction)), loop, given.rate, given.delay)
    print(design.text())
    if given.picture:
        from wam_studies.figures.stability import draw_loop  # it imports matplotlib

        draw_loop(design, given.picture)
    return int(not design.is_safe)
