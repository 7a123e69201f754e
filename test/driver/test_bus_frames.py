"""Frames of the arm's bus against a decoder of bits that was written from the facts of the bus alone."""

import random

import pytest

from wam_driver.bus import frames, properties
from wam_driver.bus.frames import BusGroup, Frame, Value
from wam_driver.bus.safety_module import WATCHED, faults, pendant_of

COUNT = 100_000


def bits(frame: Frame) -> str:
    """The data as a text of 0 and 1, first bit on the wire first."""
    return "".join(f"{byte:08b}" for byte in frame.data)


def number(text: str) -> int:
    """Two's complement."""
    return int(text, 2) - (1 << len(text)) * (text[0] == "1")


def little(text: str) -> int:
    """Two's complement of bytes whose least significant one is first."""
    return number("".join(text[at : at + 8] for at in range(len(text) - 8, -8, -8)))


def test_every_frame_is_read_by_the_independent_decoder() -> None:
    draw = random.Random(47)
    differing = 0
    for _ in range(COUNT):
        counts = [draw.randint(-8191, 8191) for _ in range(4)]
        packed = frames.torques(BusGroup.ARM, 42, counts)
        text = bits(packed)
        found = [number(text[8 + 14 * i : 22 + 14 * i]) for i in range(4)]
        node, prop, value = draw.randint(1, 14), draw.randint(0, 127), draw.randint(-(2**31), 2**31 - 1)
        written, answered = bits(frames.put(node, prop, value)), bits(frames.reply(node, prop, value))
        motor = draw.randint(-(2**21), 2**21 - 1)
        place = frames.position(node, motor)
        shown = bits(place)
        differing += [int(text[:8], 2), *found] != [0x80 + 42, *counts]
        differing += [int(written[:8], 2), written[8:16], little(written[16:])] != [0x80 + prop, "0" * 8, value]
        differing += answered != written
        differing += [shown[:2], number(shown[2:])] != ["00", motor]
        differing += frames.read_torques(packed) != counts
        with_joint = Frame(place.identifier, place.data + draw.randbytes(3))
        differing += [frames.read(one) for one in (place, with_joint)] != [Value(node, None, motor)] * 2
        differing += frames.read(frames.reply(node, prop, value)) != Value(node, prop, value)
    assert differing == 0


@pytest.mark.parametrize(("frame", "identifier", "data"), [
    (frames.get(3, 5), 0x003, "05"),
    (frames.get(BusGroup.MOTORS, 48), 0x404, "30"),
    (frames.put(10, 8, 1), 0x00A, "880001000000"),
    (frames.put(BusGroup.MOTORS, 8, 2), 0x404, "880002000000"),
    (frames.reply(10, 8, 2), 0x546, "880002000000"),
    (frames.position(2, -1), 0x443, "3fffff"),
    (frames.torques(BusGroup.WRIST, 42, [1]), 0x402, "aa00040000000000"),
    (frames.torques(BusGroup.ARM, 42, [1, -1, 8191, -8191]), 0x401, "aa0007fff7ffe001"),  # published
])  # fmt: skip
def test_frames_have_the_identifiers_of_the_bus(frame: Frame, identifier: int, data: str) -> None:
    assert (frame.identifier, frame.data.hex()) == (identifier, data)


def test_short_replies_keep_their_sign_and_other_frames_are_none() -> None:
    assert frames.read(Frame(0x426, bytes([0x85, 0, 0xFE, 0xFF]))) == Value(1, 5, -2)
    for other in (Frame(0x540, b"\x88\0\2\0"), Frame(0x403, b"12"), Frame(0x426, b"\5\0\0\0"), frames.get(3, 5)):
        assert frames.read(other) is None


@pytest.mark.parametrize(("name", "is_safety", "numbers"), [
    ("T", False, {32: 10, 49: 10, 50: 9, 60: 9, 61: 42, 200: 42}),
    ("P", False, {32: 26, 61: 48, 64: 48, 65: 48}),
    ("V", False, {50: 10, 61: 44, 113: 44, 114: 106, 118: 106, 119: 44}),
    ("CTS", False, {60: 30, 61: 65, 63: 65, 64: 66, 65: 68}),
    ("IPNM", False, {32: 108, 33: 57, 35: 57, 36: 108, 61: 83, 64: 83, 65: 86}),
    ("ECMIN", False, {44: 114, 61: 92, 65: 97, 124: 97, 125: 101, 131: 101, 132: 102}),
    ("POLES", False, {44: 112, 61: 87, 65: 90}),
    ("MODE", False, {32: 8, 200: 8}),
    ("DEF", True, {60: 89, 61: 32}),
    ("ZERO", True, {36: 55, 60: 55, 61: 42}),
    ("IFAULT", True, {60: 100, 61: 55}),
])  # fmt: skip
def test_properties_have_the_number_of_the_firmware(name: str, is_safety: bool, numbers: dict[int, int]) -> None:
    assert {version: properties.numbers(version, is_safety)[name] for version in numbers} == numbers


def test_two_properties_of_one_firmware_have_two_numbers_and_one_that_it_lacks_none() -> None:
    assert "POLES" not in properties.numbers(40)
    for is_safety in (False, True):
        for version in range(44, 210):
            numbers = properties.numbers(version, is_safety).values()
            assert len(set(numbers)) == len(numbers) > 15, version


def test_the_pendant_is_read_as_it_is_written() -> None:
    draw = random.Random(47)
    for _ in range(1000):
        lamps = {name: draw.choice("sf") for name in WATCHED}
        faulty = [name for name, lamp in lamps.items() if lamp == "f"]
        pendant = pendant_of(*faulty)
        word = f"{pendant:032b}"[::-1]
        assert ["swf"[word[3 * i : 3 * i + 3].index("1")] for i in range(len(WATCHED))] == list(lamps.values())
        assert faults(pendant | 2 << 12) == faulty, "a warning is no fault"
