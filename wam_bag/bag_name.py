"""The name of a bag that nobody has named."""

import time


def dated(name: str) -> str:
    """What is recorded, with the present date and time."""
    return f"{name}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
