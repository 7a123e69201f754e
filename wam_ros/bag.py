"""A bag on disk as rosbag2 writes it: MCAP of profile ros2 and metadata.yaml beside it.

No node and no clock of its own: who records decides what is written and at what time.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import yaml
from mcap.writer import Writer

from wam_ros.definitions import schema, type_hash
from wam_ros.message_layout import ExactLength

LIBRARY: Final = "wam_stack"
CHUNK_SIZE: Final = 1024 * 1024  # bytes; half of this is half a second of the arm, a tenth is left on disk
FLUSH_PERIOD: Final = 0.5  # s; a killed recorder loses at most this and one timer period
INFINITE: Final = {"sec": 9223372036, "nsec": 854775807}
POLICIES: Final = (
    "history", "depth", "reliability", "durability", "deadline", "lifespan", "liveliness",
    "liveliness_lease_duration", "avoid_ros_namespace_conventions",
)  # fmt: skip

Policies = Mapping[str, Any]


class RecordingError(OSError):
    """A bag that cannot be made or written; the message names the path and what to do."""


def policies(qos: Any) -> Policies:
    """The nine QoS policies as rosbag2 (version 9) writes them.

    Parameters
    ----------
    qos : an rclpy QoSProfile, or a mapping with exactly the nine policies, which is taken as it is.
    """
    if isinstance(qos, Mapping):
        if set(qos) != set(POLICIES):
            raise ValueError(f"QoS has the policies {sorted(qos)}; it needs exactly {sorted(POLICIES)}")
        return qos

    def duration(value: Any) -> dict[str, int]:
        sec, nsec = divmod(value.nanoseconds, 10**9)
        return {"sec": sec, "nsec": nsec} if value.nanoseconds else dict(INFINITE)

    liveliness = qos.liveliness.name.lower()
    return {
        "history": qos.history.name.lower(),
        "depth": qos.depth,
        "reliability": qos.reliability.name.lower(),
        "durability": qos.durability.name.lower(),
        "deadline": duration(qos.deadline),
        "lifespan": duration(qos.lifespan),
        "liveliness": "automatic" if liveliness == "system_default" else liveliness,
        "liveliness_lease_duration": duration(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def exact_cdr(name: str, data: bytes) -> bytes:
    """A serialized message without the bytes that its publisher left behind it.

    Parameters
    ----------
    name : type, ``package/msg/Type``.
    data : CDR with encapsulation header; returned as it is where it does not fit the type.
    """
    return data[: ExactLength(name)(data)]


class BagWriter:
    """Writes a new bag directory ``<path>/`` with ``<name>_0.mcap`` and, on closing, ``metadata.yaml``.

    Parameters
    ----------
    path : directory of the bag; refused where it exists.  Missing parents are made.

    Raises
    ------
    RecordingError
        where the bag cannot be made, before anything is recorded.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.closed = False
        self._file_name = f"{path.name}_0.mcap"
        _make(path)
        self._stream = (path / self._file_name).open("xb")
        self._writer: Any = Writer(self._stream, chunk_size=CHUNK_SIZE, enable_data_crcs=True)
        self._writer.start(profile="ros2", library=LIBRARY)
        self._stream.flush()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._lengths: list[ExactLength] = []
        self._topics: list[dict[str, Any]] = []
        self._counts: list[int] = []
        self._first, self._last = 2**63 - 1, 0
        self._next_flush = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_topic(self, name: str, kind: str, qos: Any) -> None:
        """Announce a topic; once, before its first message.

        Parameters
        ----------
        name : full topic name, with its namespace.
        kind : type, ``package/msg/Type``; its definition must be installed.
        qos : what the publishers offer, as `policies` takes it.
        """
        offered = [policies(qos)]
        digest = type_hash(kind)
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", schema(kind))
        channel = {"offered_qos_profiles": _yaml(offered).strip(), "topic_type_hash": digest}
        self._channels[name] = self._writer.register_channel(name, "cdr", self._schemas[kind], channel)
        self._lengths.append(ExactLength(kind))
        self._counts.append(0)
        self._topics.append(
            {
                "name": name,
                "type": kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": offered,
                "type_description_hash": digest,
            }
        )

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        """Write one message.

        Parameters
        ----------
        topic : name given to `add_topic`.
        data : CDR as it came; cut to its exact length.
        log_time, publish_time : ns.
        sequence : number that the publisher gave the message.
        """
        channel = self._channels[topic]
        length = self._lengths[channel - 1](data)
        if length < len(data):
            data = data[:length]
        self._writer.add_message(channel, log_time, data, publish_time, sequence & 0xFFFFFFFF)
        self._counts[channel - 1] += 1
        self._first = min(self._first, log_time)
        self._last = max(self._last, log_time)
        self.flush_when_due()

    def flush_when_due(self) -> None:
        """Finish the chunk every half second of wall time; call it also while no message comes."""
        now = time.monotonic()
        if now >= self._next_flush:
            self._next_flush = now + FLUSH_PERIOD
            self._writer.flush()

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file to the bag.  It bears no time, so that equal runs give equal bags."""
        self._writer.flush()
        self._writer.add_attachment(0, 0, name, media_type, data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._writer.flush()
        self._writer.add_metadata(name, dict(values))

    def close(self) -> None:
        """Finish the bag and write ``metadata.yaml``; nothing happens the second time."""
        if self.closed:
            return
        self.closed = True
        information = self._information()
        try:
            self.metadata("rosbag2", {"serialized_metadata": _yaml(information).strip()})
            self._writer.finish()
        finally:
            self._stream.close()
        temporary = self.path / "metadata.yaml.tmp"
        temporary.write_text(_yaml({"rosbag2_bagfile_information": information}), encoding="utf-8")
        temporary.replace(self.path / "metadata.yaml")

    def _information(self) -> dict[str, Any]:
        count = sum(self._counts)
        extent = {
            "duration": {"nanoseconds": self._last - self._first if count else 0},
            "starting_time": {"nanoseconds_since_epoch": self._first if count else 0},
            "message_count": count,
        }
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **extent,
            "topics_with_message_count": [
                {"topic_metadata": topic, "message_count": number}
                for topic, number in zip(self._topics, self._counts, strict=True)
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._file_name],
            "files": [{"path": self._file_name, **extent}],
            "custom_data": None,
            "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
        }


def _make(path: Path) -> None:
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        if path.parent.is_dir():
            raise RecordingError(
                f"bag {path} exists already; nothing was written. Give another name or move it away"
            ) from None
        raise RecordingError(f"{path.parent} is a file; give a directory to make bag {path.name} in") from None
    except NotADirectoryError:
        raise RecordingError(f"a parent of bag {path} is a file; give another directory") from None
    except OSError as error:
        raise RecordingError(
            f"bag {path} cannot be made: {error.strerror}; give a directory that can be written"
        ) from None


class _Plain(yaml.SafeDumper):
    """YAML without anchors, which rosbag2's reader and people read more easily."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True


def _yaml(value: Any) -> str:
    return str(yaml.dump(value, Dumper=_Plain, sort_keys=False))
