"""Trials of faults: what is tried on which nodes, what escaped, and how far the arm moved."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any, NamedTuple

from wam_description.configuration import Configuration


@dataclass(frozen=True)
class FaultLimits:
    """What counts as an escape, and how long is waited.

    Times of the arm are those of its clock; others are of the wall clock, long enough for a busy machine.
    """

    zero_current: float = 0.05  # s of the arm's time, from the loss of a node to zero current
    motion: float = 0.01  # rad, of a joint without a legitimate command
    held_motion: float = 0.2  # rad, of a joint that obeys one wrong message of its own commander until it is too old
    force: float = 15.0  # N, of the arm on the world without a legitimate command

    longest_start: float = 120.0  # s of a stack
    patience: float = 15.0  # s of work without progress and without a fault that is a hang
    answered: float = 5.0  # s, for the answer of a service
    idle: float = 0.25  # s of work that a second of waiting counts as
    rest: float = 0.2  # s of work after which the time of an arm in fault is known to be at rest

    messages: int = 20  # of one trial
    between: float = 0.001  # s of the arm's time between two of them
    after: float = 0.03  # s of the arm's time after the last
    flood: int = 10  # messages in each period, which is 10 kHz
    flooded: float = 0.03  # s of the arm's time before the emergency stop
    stopped: float = 0.02  # s of the arm's time, from the request to the answer of an emergency stop
    streamed: float = 0.15  # s of the arm's time with two publishers
    after_publishers: float = 0.05  # s of the arm's time that is watched afterwards

    noticed: float = 5.0  # s, in which a loss must be reported
    recovered: float = 20.0  # s, in which an operator gets an enabled arm again
    frozen: tuple[float, float] = (0.2, 1.5)  # s that a driver is frozen

    push: float = 3.0  # N, after which a stable arm is slow
    pushed: float = 0.02  # s
    settling: float = 0.1  # s
    fast: float = 1.0  # rad/s

    move: float = 2.0  # s of a move of the soak
    postures: int = 4  # that are gone to, one after the other
    along: float = 0.75  # of the last cover, where it is pushed
    growth: float = 20.0  # MB from a tenth of the run on to its end


FAULTS = FaultLimits()


class FaultCase(NamedTuple):
    """One trial of a kind, by its number; it depends on kind, seed and number alone."""

    configuration: Configuration
    kind: str
    seed: int
    number: int

    def __str__(self) -> str:
        return f"{self.kind} {self.number}, seed {self.seed}"

    @property
    def chance(self) -> Random:
        """Random numbers of this trial: those in lockstep have the same as those in realtime."""
        return Random(f"{self.kind.partition('-')[0]} {self.seed} {self.number}")


class FaultTrial(NamedTuple):
    """What one trial has shown.

    Attributes
    ----------
    kind : of the fault.
    name : the fault, in words.
    size : messages, sets, losses and so on in it.
    escapes : what went wrong.
    motion : rad, largest motion of a joint that nobody had commanded.
    force : N, largest true force on the world.
    delay : s of the arm's time from a loss to zero current, or to the answer of an emergency stop; NaN for neither.
    """

    kind: str
    name: str
    size: int = 1
    escapes: tuple[str, ...] = ()
    motion: float = 0.0
    force: float = 0.0
    delay: float = math.nan


class NodeKeeper:
    """The nodes that trials run on, one set at a time in a network, kept from one trial to the next."""

    def __init__(self) -> None:
        self._key: Any = None
        self._kept: Any = None

    def ready(self, make: Callable[[Configuration], Any], configuration: Configuration) -> Any:
        """The nodes that `make` makes of a configuration: those of the last trial where they are the same.

        Parameters
        ----------
        make : makes what has a method `close`.
        configuration : of the nodes.
        """
        if self._key != (make, configuration):
            self.discard()
            self._kept, self._key = make(configuration), (make, configuration)
        return self._kept

    def discard(self) -> None:
        """End the nodes: one has ended, their parameters have changed, or they cannot be enabled."""
        kept, self._key, self._kept = self._kept, None, None
        if kept is not None:
            kept.close()


KEPT = NodeKeeper()  # of this process
