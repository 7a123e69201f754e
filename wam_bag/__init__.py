"""Bags of ROS 2 (MCAP) written, read as numpy columns, and repaired; usable alone, without ROS.

For users:

- `bag`: `read` makes numpy columns of a bag, or lists what is in it; `Bag`, `BagError`.
- `losses`: what a bag lacks, from the records of the recorder and of repairs.
- `bag_writer`: `BagWriter` writes a bag directory, in one file or several, and closes it on a full disk.  `bag_name`:
  the name of one that nobody has named.
- `repair`: `repair` writes files that are broken or were not closed again from what can be read.
- `errors`: `BagError`, `RecordingError`, and what is raised within the package.
- `printable`: text from outside without control characters, for terminals and logs.

Messages:

- `columns`: the columns of each message type; `arrays`: their types. `point_clouds`: points of PointCloud2 as a table.
- `message_groups`: messages of equal layout decoded together. `cdr`: the codec; `value_messages`: one value each, fast.
- `message_text`: fields of a type from its definition. `definitions`: those of `messages.json`.

Files:

- `bag_file`: the files of a bag found and opened, messages selected by topic and time.
- `mcap_file`: an MCAP file opened for reading. `message_search`: messages found in a chunk.
- `mcap_writer`: an MCAP file written. `mcap_records`: records by the `mcap` library, with bounds and limits.
- `rosbags_file`: a bag of ROS 1 or of SQLite, read by rosbags.
- `limits`: of what is read. `metadata`: metadata.yaml. `safe_yaml`: YAML with bounded effort.
"""
