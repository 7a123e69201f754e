"""A scenario that the page plays into a running stack: the scenario node as a process of its own."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from threading import Thread

import yaml

from wam_control.task.scenario import load, script_file
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError, listed, values
from wam_live.thresholds import LIVE
from wam_ros.bring_up import NO_FAILURE, NodeProcess

NODE = "scenario"


class ScenarioPlayer:
    """Starts the scenario node for a stack that has none.

    Parameters
    ----------
    shared : parameters of the stack.
    namespace : of the stack.
    """

    def __init__(self, shared: Shared, namespace: str) -> None:
        self._shared, self._namespace = shared, namespace
        self._node: NodeProcess | None = None
        self._folder = tempfile.TemporaryDirectory()

    def move(self, start: Sequence[float], end: Sequence[float]) -> str:
        """Move from posture to posture, rad; returns why that is not possible, '' where it is."""
        most = max(abs(b - a) for a, b in zip(start, end, strict=True))
        step = {
            "name": "bend the arm",
            "seconds": max(LIVE.shortest, round(most / LIVE.speed, 1)),
            "posture": list(end),
        }
        file = Path(self._folder.name) / "move.yaml"
        file.write_text(yaml.safe_dump({"steps": [step]}), encoding="utf-8")
        return self.play(str(file))

    def play(self, script: str) -> str:
        """Begin a scenario, named or as a file; returns why that is not possible, '' where it is."""
        if NODE in self._shared.nodes:
            return "this stack plays a scenario of its own; start it without --scenario"
        if self._node is not None:
            return "a scenario is being played; stop it first"
        try:
            file = script_file(script)
            load(file, self._shared)
        except ParameterError as error:
            return str(error)
        flat = {name: listed(value) for name, value in values(self._shared).items()}
        own = Configuration(file, {NODE: {**flat, "script": str(Path(file).resolve())}})
        self._node = NodeProcess(own, [NODE], self._namespace)
        return ""

    def ended(self) -> str:
        """How the scenario ended, once; '' before and after."""
        if self._node is None or (code := self._node.poll()) is None:
            return ""
        self._node = None
        failed = "the scenario failed; its status and the console have the reason"
        return "the scenario has ended" if code in NO_FAILURE else failed

    def stop(self) -> None:
        """Let the scenario end, while the page goes on; the arm holds its posture."""
        if self._node is not None:
            Thread(target=self._node.close).start()

    def close(self) -> None:
        """End the scenario and leave no file."""
        self.stop()
        self._folder.cleanup()
