"""Bags of ROS 1, of SQLite and those compressed by rosbag2, opened for reading by rosbags: without checksums."""

import importlib
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from mcap.records import Channel, Schema

from wam_bag.cdr import CDR, ROS1, SCHEMAS
from wam_bag.errors import BagError
from wam_bag.mcap_file import BATCH, BagFile
from wam_bag.mcap_records import MessageCounts
from wam_bag.message_search import NEVER, MessageBatch, packed

SUFFIXES: Final = (".bag", ".db3")


class RosbagsFile(BagFile):
    """A bag that rosbags reads, see `BagFile`; it raises whatever rosbags does."""

    def open(self) -> None:
        """List the topics."""
        try:
            rosbags: Any = importlib.import_module("rosbags.highlevel.anyreader")
        except ImportError:
            raise BagError(
                f"{self.path} is not plain MCAP; rosbags reads it: pip install 'wam_stack[rosbags]'"
            ) from None
        store = rosbags.get_typestore(importlib.import_module("rosbags.typesys").Stores.ROS2_HUMBLE)
        # where the bag defines no types
        reader = self.enter_context(rosbags.AnyReader([self.path], default_typestore=store))
        self._reader, encoding = reader, CDR if reader.is2 else ROS1
        for one in reader.connections:
            is_known = one.msgtype in reader.typestore.fielddefs
            text = reader.typestore.generate_msgdef(one.msgtype, ros_version=1 + reader.is2)[0] if is_known else ""
            self.schemas[one.id] = Schema(one.id, text.encode(), SCHEMAS[encoding] if is_known else "", one.msgtype)
            self.channels[one.id] = Channel(one.id, one.topic, encoding, {}, one.id)
        counts = Counter({one.id: one.msgcount for one in reader.connections})
        first, last = (reader.start_time, reader.end_time - 1) if reader.message_count else (0, 0)
        self.counts = MessageCounts(first, last, counts)

    def batches(
        self, channels: frozenset[int] | None = None, begin: int = 0, end: int = NEVER
    ) -> Iterator[MessageBatch]:
        """Messages as `BagFile.batches`, of all times."""
        self.loaded = MessageCounts()
        reader, size = self._reader, 0
        found: list[tuple[int, int, bytes]] = []
        wanted = [one for one in reader.connections if channels is None or one.id in channels]
        for one, time, data in reader.messages(wanted) if wanted else ():
            found.append((one.id, time, data))
            size += len(data)
            if size >= BATCH:
                yield self._taken(packed(found))
                found, size = [], 0
        if found:
            yield self._taken(packed(found))
