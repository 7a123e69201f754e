"""Where the searches of the theory begin and end, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SearchThresholds:
    """Precision and length of searches for cycles, margins and gains."""

    flank_change: float = 1e-8  # relative, of the state at the flank from one half cycle to the next: a cycle
    half_cycles: int = 5000  # within which a backlash cycle is found
    contact_steps: int = 200  # per time constant of the loop, in the search of the end of a contact
    # rad per sample at the margin: below, the polynomials of the held loop cancel
    fast: float = 1e-3
    # rad of delay at the margin: up to it the first crossing has the smallest gain
    short_delay: float = 0.5
    first_step: float = 1e-3  # of the friction, first step in the search for a stiction cycle
    slips: int = 200  # within which a cycle is found or the response diverges, with stiction
    diverged: float = 1e100  # rad; the simulation of stick-slip ends beyond it
    mode_growth: float = 1e-7  # of a mode in one period, that counts as none
    mode_memory: float = 1e-9  # of a mode after a period, below which it is none
    scale_step: float = 0.8  # from one scale of the gains that is tried to the next
    smallest_scale: float = 1e-15  # of the gains, at which a search ends


@dataclass(frozen=True, slots=True)
class DesignThresholds:
    """How a force loop with friction is examined, and which numbers of it are taken."""

    longest_delay: int = 50  # periods
    close: float = 0.9  # of the margin; no plant is known better
    absurd: float = 1e12  # a number of the loop above it, or below its inverse but not 0, is a slip of the pen
    # fractions of the largest contact stiffness that are considered
    softer: tuple[float, ...] = (1.0, 0.6, 0.35, 0.2, 0.1, 0.03)
    # of F_des, in saturations, which have to come to rest
    steps: tuple[float, ...] = (0.3, 0.8, 1.0, 1.5, 3.0, 10.0, 50.0)
    # saturations, in F_static
    candidates: tuple[float, ...] = (100.0, 50.0, 25.0, 12.0, 6.0, 4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5)
    # accepted fraction of the largest saturation found good: between the candidates tried, worse ones may be
    sure: float = 0.7
    events: int = 4000  # of the exact integrator, after which a response counts as not settled
    patient_events: int = 40_000  # the same for a loop that is designed: there is time
    # rad of the node's own frequency per sample: a faster loop without delay is examined as a continuous one
    continuous: float = 0.1
    cycle_excess: float = 2.0  # largest cycle that counts as the stiction cycle, in sizes of (5.8); a delay enlarges it


SEARCH, DESIGN = SearchThresholds(), DesignThresholds()
