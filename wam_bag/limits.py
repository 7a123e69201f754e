"""Limits of what is read from a bag, each with its unit and its reason."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ReadingLimits:
    """A file, its texts and its messages."""

    expanded: int = 2**29  # bytes that a file may decompress to whatever its size
    expansion: int = 1000  # times the size of a file, that are decompressed; recordings have 5 to 100
    metadata: int = 2**26  # bytes of metadata.yaml
    yaml_depth: int = 50  # nested maps and lists; the C loader recurses and would end the process at some thousands
    yaml_length: int = 2**22  # bytes; the longest files of our own, of bags of a thousand files, have a tenth of it
    counts_kept: int = 256  # counts of a layout that are kept; a longer message is walked through each time
    layouts: int = 64  # that are kept of a topic; further ones are found message by message
    digits: int = 20  # digits of a count
    named: int = 3  # topics that a sentence lists


READING_LIMITS = ReadingLimits()
