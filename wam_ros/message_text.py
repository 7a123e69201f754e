"""Messages as plain data, to print."""

from typing import Any

from wam_description.topics import BY_NAME, TABLE
from wam_ros.header import stamp_of
from wam_ros.messages import read_table


def plain(message: Any, topic: str = "") -> Any:
    """A message as mappings, lists and numbers; a table of the stack as its rows."""
    row = BY_NAME.get(topic)
    if row is not None and row.type == TABLE:
        table = read_table(message, row.columns, [message.header.frame_id, *[""] * 100])
        return {
            "stamp": stamp_of(message),
            "rows": [dict(zip(row.columns, found, strict=True)) for found in table.rows],
        }
    if hasattr(message, "get_fields_and_field_types"):
        return {name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes) or hasattr(message, "tolist"):
        return list(message)
    return [plain(item) for item in message] if isinstance(message, list) else message
