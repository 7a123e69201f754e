"""Every numbered equation of chapters 2 to 6: its content, and the correction of its misprint.

A function that implements an equation cites its number in the first line of its docstring; `docs/thesis.md`
is generated from these citations and from this table.  Reasons of the corrections: `docs/errata.md`.
"""

from typing import NamedTuple


class Equation(NamedTuple):
    """One numbered equation.

    Attributes
    ----------
    number : as printed.
    section : of the thesis.
    content : in a few words.
    correction : of the print; empty if it is right as printed.
    reason : why it has no function; empty if it has one.
    """

    number: str
    section: str
    content: str
    correction: str = ""
    reason: str = ""


EQUATIONS: tuple[Equation, ...] = (
    Equation("2.1", "2.1.1", "contact force from two joint torques", "cos theta_2 is missing; straight arm only"),
    Equation("2.2", "2.1.1", "contact position", "cos theta_2 is missing; straight arm only"),
    Equation("3.1", "3.2.2", "greatest force of an impact", "J is the effective mass at the contact"),
    Equation("3.2", "3.2.4", "useful length of a link in a grasp", "tan(theta/2) = mu, not tan(theta) = mu"),
    Equation("3.3", "3.2.4", "largest cylinder that two links hold", "tan(theta/2) = mu, not tan(theta) = mu"),
    Equation(
        "4.1",
        "4.1.2, 4.2",
        "stiffness of a transmission with the reducer between its ends; position transfer function without reducer",
        "two equations have this number",
    ),
    Equation(
        "4.2", "4.2", "position transfer function with the reducer at the joint", "numerator N k_tr, not N^2 k_tr"
    ),
    Equation("4.3", "4.3.1", "force transfer function", "numerator N k_tr k_c"),
    Equation(
        "4.4",
        "4.3.1",
        "resonances of the force transfer function",
        "right, but the lower root loses digits; use 2c/(B + root)",
    ),
    Equation("4.5", "4.3.1", "limit of the lower resonance for a soft contact"),
    Equation("4.6", "4.3.1", "limit of the lower resonance for a hard contact"),
    Equation(
        "4.7", "4.3.1", "limits of both resonances for a small ratio N", "the printed values are squares of omega_1"
    ),
    Equation("4.8", "4.3.1", "limit of the lower resonance for a large N"),
    Equation("4.9", "4.3.2", "best contact stiffness", "gives 8.27e5 lb-in/rad, 638 lb/in, not 9e5 and 650"),
    Equation("4.10", "4.4", "best transmission stiffness", "J_t is J_l; the asymptote above it is sqrt(k_tr/J_m)"),
    Equation("5.1", "5.3", "steady error of proportional control"),
    Equation("5.2", "5.3", "time constant of integral control"),
    Equation("5.3", "5.4", "delay by Coulomb friction", "first breakaway only; else minus sgn(e) f, and |e|"),
    Equation("5.4", "5.4", "when a node is nearly inertialess"),
    Equation("5.5", "5.4", "motion of the motor while the node sticks"),
    Equation("5.6", "5.4", "contact force during a slip", "without damping only"),
    Equation("5.7", "5.4", "difference of static and dynamic friction"),
    Equation("5.8", "5.4", "size of the stiction limit cycle", "peak to peak, not amplitude"),
    Equation("5.9", "5.4", "period of the stiction limit cycle", "Omega belongs under 2 F_static/dF, not in front"),
    Equation(
        "5.10", "5.4", "overshoot Omega of a slip", "Omega = 1 + exp(-pi zeta/sqrt(1 - zeta^2)); 1 from zeta = 1 on"
    ),
    Equation("5.11", "5.4", "when the cycle is that of (5.8), (5.9)"),
    Equation("5.12", "5.4", "damping ratio"),
    Equation("5.13", "5.4", "when the response is a staircase"),
    Equation("5.14", "5.5", "transfer function of the loop", "G_P s, not G_P/s"),
    Equation("5.15", "5.5", "Routh's criterion"),
    Equation("5.16", "5.5.1", "candidate limit cycle by describing function"),
    Equation("5.17", "5.5.2", "stability of a friction-dominated system"),
    Equation("5.18", "5.5.2", "Psi, ratio of half cycles", "inverse ratio: the later over the earlier"),
    Equation("5.19", "5.5.3", "limit of the sticking time", "finite and constant for Psi below 0"),
    Equation("5.20", "5.5.3", "size of the motor's limit cycle", "peak to peak; only for Psi between 0 and 1"),
    Equation("5.21", "5.5.3", "work of this limit cycle, per half cycle", "F^2/(2 k_tr)"),
    Equation("5.22", "5.5.3", "power of this limit cycle"),
    Equation("5.23", "5.7", "Routh's criterion with proportional control"),
    Equation("6.1", "6.2.2", "Hooke's law"),
    Equation("6.2", "6.2.2", "strain of the strands"),
    Equation("6.3", "6.2.2", "ratio of the speeds of the strands"),
    Equation("6.4", "6.2.2", "ratio of the speeds of the strands, to first order"),
    Equation("6.5", "6.2.3", "heat out of the control volume", "right to first order of the strain"),
    Equation("6.6", "6.2.3", "when kinetic energy is negligible", "its ratio to the loss is twice that"),
    Equation("6.7", "6.2.3", "when weight is negligible", "EA^2 is E A^2; ratio 1 is at 2535 in, not 275"),
    Equation("6.8", "6.2.4", "speed of a pulley to which the cable sticks at the entry"),
    Equation("6.9", "6.2.4", "speed of a pulley to which the cable sticks at the exit"),
    Equation("6.10", "6.2.4", "loss for either sticking point", "the last term is an artefact of (6.5)"),
    Equation("6.11", "6.2.4", "loss at the driven pulley"),
    Equation("6.12", "6.2.4", "loss at the drive pulley"),
    Equation("6.13", "6.2.4", "power out"),
    Equation("6.14", "6.2.4", "limiting efficiency of a stage"),
    Equation("6.15", "6.2.4", "limiting efficiency of n stages"),
    Equation("6.16", "6.2.5", "arc of slip"),
    Equation("6.17", "6.3.1", "driven angle without creep"),
    Equation("6.18", "6.3.1", "driven angle with creep"),
    Equation("6.19", "6.3.1", "creep", "abs(d theta_a): the signed differential gives none out and back"),
    Equation("6.20", "6.3.1", "creep never vanishes"),
    Equation("6.21", "6.4", "", reason="does not exist: the print goes from (6.20) to (6.22)"),
    Equation("6.22", "6.4.4", "Coulomb-like torque of the loss", "one pulley; both are twice that"),
    Equation("6.23", "6.5", "ripple of an eccentric pulley", "2 eps T is the amplitude: 1 in-lb in the example"),
)
