"""What the force loop did instead of what was commanded, when and why, from its recorded status."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wam_control.force_hold import ForceReaction
from wam_description.status import REFUSED
from wam_sim.recording import RecordedRun

FAULT, REFUSAL = "fault", "refused"
BRIEF = 50_000_000  # ns; what lasts no longer into a step belongs to the one before
NOT_REACHED, NOT_FOLLOWED = (one.name.lower() for one in (ForceReaction.NOT_REACHED, ForceReaction.NOT_FOLLOWED))
HOLDING = {*(one.name.lower() for one in ForceReaction if one.holds), FAULT, REFUSAL}


class RecordedReaction(NamedTuple):
    """A time in which a command was not simply obeyed.

    Attributes
    ----------
    begin, end : ns.
    name : of a `ForceReaction`, or FAULT of the driver, or REFUSAL of a command beyond a limit.
    reason : in words, as it was reported when it began.
    """

    begin: int
    end: int
    name: str
    reason: str

    @property
    def holds(self) -> bool:
        """Whether the force was not controlled meanwhile."""
        return self.name in HOLDING


def within(reactions: Sequence[RecordedReaction], begin: int, end: int) -> tuple[RecordedReaction, ...]:
    """The parts of reactions between two times, ns."""
    parts = (one._replace(begin=max(one.begin, begin), end=min(one.end, end)) for one in reactions)
    return tuple(one for one in parts if one.end - one.begin > BRIEF or (one.begin < one.end == end))


def sentences(name: str, reactions: Sequence[RecordedReaction], zero: int) -> list[str]:
    """One for each kind of reaction to a command of this name: when, from `zero` on, ns, how often and why."""
    stated = []
    for kind in dict.fromkeys(one.name for one in reactions):
        first, *others = [one for one in reactions if one.name == kind]
        verb = kind if kind == REFUSAL else f"{REFUSAL if first.holds else 'reported'} ({kind})"
        again = f" and {len(others)} times more" if others else ""
        begin, end = ((stamp - zero) / 1e9 for stamp in (first.begin, first.end))
        stated.append(f"{name}: {verb} from {begin:.2f} to {end:.2f} s{again}: {first.reason}")
    return stated


def reactions_of(run: RecordedRun, end: int) -> tuple[RecordedReaction, ...]:
    """All of a run up to its end, ns, in the order of time; one that only changes its numbers goes on."""
    found: list[RecordedReaction] = []
    for node in ("force_loop", "driver"):
        present: RecordedReaction | None = None
        for stamp, status in run.stamped_statuses():
            if status.node != node:
                continue
            name, reason = _reaction(node, status.facts, status.fault, status.message)
            if present is not None and name != present.name:
                found.append(present._replace(end=stamp))
                present = None
            if name and present is None:
                present = RecordedReaction(stamp, end, name, reason)
            elif present is not None and reason.startswith(present.reason):
                present = present._replace(reason=reason)  # with what would help, which is found later
        if present is not None:
            found.append(present)
    return tuple(sorted(one for one in found if one.end > one.begin))


def _reaction(node: str, facts: Mapping[str, str], fault: str, message: str) -> tuple[str, str]:
    if node == "driver":
        return (FAULT, fault) if fault else ("", "")
    name = facts.get("reaction", "none")
    if name != "none":
        return name, message
    return (REFUSAL, message) if facts.get(REFUSED) else ("", "")
