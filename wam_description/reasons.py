"""Why an estimate of a contact is not to be trusted, as codes; the words are in `event_text`."""

from enum import IntFlag, auto


class Reason(IntFlag):
    """Why the position of a contact is unknown, or an estimate is not reliable; numbered as in `contact/hypotheses`."""

    MOMENT_ONLY = auto()  # only the moment of the force is measured on this link
    POSE = auto()  # in this pose the torques of no usual force show its position
    WEAK = 16  # the torques are too small for a position
    LINKS = 128  # the torques do not identify the link
    MORE = auto()  # one contact does not explain the torques
    ALONG = auto()  # the force may act along the link
    PAYLOAD = auto()  # a payload that was picked up may explain the torques
    TOO_EARLY = auto()  # no estimate: too few samples yet
    BRAKED = auto()  # no estimate: brakes hold the motors


NO_REASON = Reason(0)
