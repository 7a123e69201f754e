"""Parameters of the contact inference: what is known of a contact before it is detected."""

from dataclasses import dataclass

from wam_description.parameters import parameter


@dataclass(frozen=True)
class InferenceParameters:
    """Prior probabilities of a contact, before it is detected."""

    aligned_with = "inference", "covers"
    weights: tuple[float, ...] = parameter("relative frequency of contacts on each cover", low=1e-3, high=1e3)
    force_scale: float = parameter("prior sd of each component of a contact's force", "N", low=0.1, high=1e4)
    moment_arm_offset: float = parameter(
        "sd of the distance between the line of the force and the axis of the tube, as a fraction of the tube's radius",
        high=2.0,
    )
    friction: float = parameter("sd of the friction force along a cover, as a fraction of the force", high=2.0)
    end_weight: float = parameter(
        "relative frequency of contacts at the ends of two links where they meet, for each of the two links", high=1e3
    )
    along_weight: float = parameter(
        "relative frequency of forces along the last link, for each of surface and end", high=1e3
    )
    payload_weight: float = parameter(
        "relative frequency of a mass that is picked up at the tool",
        high=1e3,
    )
    fusion_time: float = parameter(
        "time over which the torques of a contact are combined; 0: only the present sample is used",
        "s",
        high=10.0,
    )
    positions: int = parameter("contact positions tried along a link", low=9, high=200)
    identification_threshold: float = parameter(
        "probability from which the link in contact is identified", low=0.5, high=1.0
    )
    largest_residual: float = parameter("chi^2 above which one contact does not explain the torques", high=1e6)
