"""What a person asks of a running stack by one word, on the page or from a shell."""

from typing import Final

from wam_description.wiring import Call

SERVICES: Final[dict[str, tuple[str, tuple[Call, ...]]]] = {  # what it does, and its requests
    "enable": ("let the motors follow the commands", (Call("driver", "enable", True),)),
    "disable": ("brake the arm", (Call("driver", "enable", False),)),
    "estop": ("stop at once; the arm stays stopped until reset_fault", (Call("driver", "estop"),)),
    "reset_fault": ("end a fault whose cause is gone", (Call("driver", "reset_fault"),)),
    "confirm_home": ("report to the driver that a real arm is in its home pose", (Call("driver", "confirm_home"),)),
    "reset": ("put the simulated arm back to its start", (Call("driver", "reset"),)),
    "tare": ("set the measured forces to zero, while nothing touches the arm", (Call("force_loop", "tare"),)),
    "pause": ("stop the time of the simulated arm", (Call("driver", "pause", True),)),
    "step": (
        "pause, then advance the simulated arm by one period",
        (Call("driver", "pause", True), Call("driver", "step")),
    ),
    "resume": ("resume the time of the simulated arm", (Call("driver", "pause", False),)),
}
