"""Numbers of the properties of a controller by the version of its firmware; from libbarrett, `property_list.cpp`."""

from bisect import bisect_right
from typing import Final

# first version, and the number from that version on
ALWAYS: Final = {"VERS": 0, "ROLE": 1, "SN": 2, "ID": 3, "ERROR": 4, "STAT": 5, "ADDR": 6, "VALUE": 7, "MODE": 8}
MOTOR: Final = {
    "T": ((32, 10), (50, 9), (61, 42)),
    "MT": ((32, 16), (61, 43)),
    "P": ((32, 26), (61, 48)),
    "V": ((32, 12), (50, 10), (61, 44), (114, 106), (119, 44)),
    "MECH": ((32, 28), (61, 63), (64, 64), (65, 66)),
    "CTS": ((32, 30), (61, 65), (64, 66), (65, 68)),
    "PIDX": ((32, 54), (61, 67), (64, 68), (65, 70)),
    "TSTOP": ((32, 64), (33, 66), (36, 64), (61, 75), (65, 78)),
    "IPNM": ((32, 108), (33, 57), (36, 108), (61, 83), (65, 86)),
    "POLES": ((44, 112), (61, 87), (65, 90)),
    "GRPA": ((32, 51), (61, 26)),
    "GRPB": ((32, 52), (61, 27)),
    "GRPC": ((32, 53), (61, 28)),
    "TENSION": ((32, 70), (61, 17)),
    "TEMP": ((32, 39), (61, 9)),
    "ECMIN": ((44, 114), (61, 92), (65, 97), (125, 101), (132, 102)),
    "ECMAX": ((44, 113), (61, 91), (65, 96), (125, 100), (132, 101)),
}
SAFETY: Final = {
    "ZERO": ((36, 55), (61, 42)),
    "PEN": ((36, 85), (61, 43)),
    "SAFE": ((36, 86), (61, 44)),
    "VL1": ((36, 90), (61, 45)),
    "VL2": ((36, 91), (61, 46)),
    "TL1": ((36, 92), (61, 47)),
    "TL2": ((36, 93), (61, 48)),
    "VOLTL1": ((36, 94), (61, 49)),
    "VOLTL2": ((36, 95), (61, 50)),
    "VOLTH1": ((36, 96), (61, 51)),
    "VOLTH2": ((36, 97), (61, 52)),
    "IFAULT": ((36, 100), (61, 55)),
}
STORED: Final = {"SAVE": ((32, 87), (61, 30)), "LOAD": ((32, 88), (61, 31)), "DEF": ((32, 89), (61, 32))}


def number(name: str, version: int, is_safety_module: bool = False) -> int:
    """Number of a property.

    Raises
    ------
    KeyError
        where the firmware of this version has no such property.
    """
    if name in ALWAYS:
        return ALWAYS[name]
    rows = ((SAFETY if is_safety_module else MOTOR) | STORED)[name]
    at = bisect_right([first for first, _ in rows], version)
    if not at:
        raise KeyError(f"firmware {version} has no property {name}; it came with {rows[0][0]}")
    return rows[at - 1][1]
