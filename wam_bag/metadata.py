"""metadata.yaml of a bag, as rosbag2 (version 9) writes it."""

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import yaml
from mcap.records import Channel, Schema

from wam_bag import safe_yaml
from wam_bag.mcap_records import MessageCounts, together

LIBRARY: Final = "wam_stack"  # that writes the files
INFINITE: Final = {"sec": 9223372036, "nsec": 854775807}


def offered(depth: int = 1000, is_latched: bool = False) -> dict[str, Any]:
    """The QoS policies of a reliable publisher, as rosbag2 (version 9) writes them."""
    return {
        "history": "keep_last", "depth": depth, "reliability": "reliable",
        "durability": "transient_local" if is_latched else "volatile", "deadline": INFINITE, "lifespan": INFINITE,
        "liveliness": "automatic", "liveliness_lease_duration": INFINITE, "avoid_ros_namespace_conventions": False,
    }  # fmt: skip


def bag_information(
    files: Mapping[str, MessageCounts], topics: Sequence[Mapping[str, Any]], counts: Sequence[int]
) -> dict[str, Any]:
    """Content of metadata.yaml (version 9 of rosbag2).

    Parameters
    ----------
    files : of the bag in their order, by name.
    topics : name, type, serialization_format, offered_qos_profiles and type_description_hash of each.
    counts : messages of each topic.
    """
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **_extent(files.values()),
        "topics_with_message_count": [
            {"topic_metadata": topic, "message_count": count} for topic, count in zip(topics, counts, strict=True)
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [*files],
        "files": [{"path": name, **_extent([found])} for name, found in files.items()],
        "custom_data": None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }


def _extent(parts: Iterable[MessageCounts]) -> dict[str, Any]:
    first, last, numbers = together(parts)
    return {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": numbers.total(),
    }


def write_metadata(path: Path, information: Mapping[str, Any]) -> None:
    """Write metadata.yaml of a bag directory, whole or not at all."""
    temporary = path / "metadata.yaml.tmp"
    temporary.write_text(safe_yaml.dump({"rosbag2_bagfile_information": information}), encoding="utf-8")
    temporary.replace(path / "metadata.yaml")


def topic_information(channel: Channel, schema: Schema) -> dict[str, Any]:
    """One topic in metadata.yaml, from its records in a file."""
    return {
        "name": channel.topic,
        "type": schema.name,
        "serialization_format": channel.message_encoding,
        "offered_qos_profiles": profiles(channel.metadata.get("offered_qos_profiles", "")),
        "type_description_hash": channel.metadata.get("topic_type_hash", ""),
    }


def profiles(text: str) -> Any:
    """QoS policies that a topic's publishers offer; defaults if there are none or they cannot be read."""
    with contextlib.suppress(yaml.YAMLError):
        return safe_yaml.load(text) or [offered()]  # readers drop a topic that offers nothing
    return [offered()]
