"""What the recorder takes: every topic; it publishes nothing but its status and diagnostics."""

from dataclasses import dataclass
from pathlib import Path

from wam_description.parameters import ParameterError, parameter
from wam_description.topics import BY_NAME

EVERY = "*"


@dataclass(frozen=True)
class RecorderParameters:
    """Directory and contents of the bag."""

    directory: str = parameter("directory of the bag; created if it is missing")
    name: str = parameter("name of the bag, a new directory; empty: arm, date and time of the start")
    topics: tuple[str, ...] = parameter("recorded topics, named as in docs/topics.md; '*' for all")
    required: bool = parameter("whether the arm brakes when the bag can no longer be written")
    split_size: int = parameter("size at which the bag continues in another file; 0: never", "byte", 0, 2**50)
    split_time: float = parameter("time after which the bag continues in another file; 0: never", "s", 0.0, 1e7)

    def __post_init__(self) -> None:
        for topic in self.topics:
            if topic != EVERY and topic not in BY_NAME:
                raise ParameterError(f"parameter 'topics' names '{topic}'; allowed: {EVERY}, {', '.join(BY_NAME)}")
        if self.name != Path(self.name).name or self.name == "..":
            raise ParameterError(f"parameter 'name' is '{self.name}'; allowed: a name without directories")


class RecorderInterface:
    """Node `recorder`."""

    name = "recorder"
    parameters = "wam_ros.recorder_interface:RecorderParameters"
    ros_node = "wam_ros.recorder_node:RecorderNode"
    sources: tuple[str, ...] = ()
