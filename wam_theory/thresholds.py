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


SEARCH = SearchThresholds()
