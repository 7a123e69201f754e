"""What the force loop does instead of what is commanded, as its status has it, and back."""

from collections.abc import Mapping

from wam_control.force.force_hold import ForceReaction
from wam_description.signals import NodeStatus
from wam_description.status import REACTION, REFUSED

REFUSAL = "refused"  # in place of a reaction: a command is not taken, as it is beyond a limit or has no effect
NONE, CONTACT_FORCE, NOT_REACHED, NOT_FOLLOWED = (
    one.name.lower()
    for one in (
        ForceReaction.NONE,
        ForceReaction.CONTACT_FORCE,
        ForceReaction.NOT_REACHED,
        ForceReaction.NOT_FOLLOWED,
    )
)
NAMES = {one.name.lower() for one in ForceReaction} - {NONE}
HOLDING = {REFUSAL, *(one.name.lower() for one in ForceReaction if one.holds)}


def facts_of(reactions: Mapping[ForceReaction, str], refused: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Message and facts of reactions, the most serious first, and of commands that are not taken, by topic.

    The message is why a command is refused, where nothing holds the arm, or else all reasons of the reactions.
    """
    named = {one.name.lower(): why for one, why in reactions.items()}
    first = next(iter(named), NONE)
    refusal = next(iter(refused.values()), "") if first not in HOLDING else ""
    facts = {REACTION: first} | (named if refusal or len(named) > 1 else {})
    return refusal or "; ".join(named.values()), facts | ({REFUSED: ", ".join(refused)} if refused else {})


def stated(status: NodeStatus) -> dict[str, str]:
    """Each reaction in a status of the force loop with its reason, the most serious first; REFUSAL for a refusal."""
    facts, first = status.facts, status.facts.get(REACTION, NONE)
    found = {name: facts.get(name, status.message) for name in (first, *facts) if name in NAMES}
    if facts.get(REFUSED) and first not in HOLDING:
        # in recordings of old the message is that of the reaction
        refusal = status.message if first == NONE or first in facts else facts[REFUSED]
        return {REFUSAL: refusal, **found}
    return found
