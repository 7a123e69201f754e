"""Why an estimate of a contact is not to be trusted, as codes; the words are in `event_text`."""

from enum import IntFlag, auto


class Reason(IntFlag):
    """Why the position of a contact is unknown, or an estimate is not reliable; numbered as in `contact/hypotheses`."""

    MOMENT_ONLY = auto()  # only the moment of the force is measured on this link
    BENT = auto()  # elbow at 90 deg and force in plane
    STRAIGHT = auto()  # elbow straight and force out of plane: not the position
    SHOULDER = auto()  # the axes of the shoulder leave one moment unmeasured
    WEAK = auto()  # the torques are too small for a position
    ELBOW = auto()  # a contact at the elbow is one of either link
    STRAIGHT_LINK = auto()  # elbow straight and force out of plane: not the link
    LINKS = auto()  # the torques do not identify the link
    MORE = auto()  # one contact does not explain the torques
    ALONG = auto()  # the force may act along the link
    PAYLOAD = auto()  # a payload that was picked up may explain the torques
    TOO_EARLY = auto()  # no estimate: too few samples yet
    BRAKED = auto()  # no estimate: brakes hold the motors


NO_REASON = Reason(0)
