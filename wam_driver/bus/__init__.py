"""The driver of a production WAM on its CAN bus, and a simulator of that bus.

- frames: requests, packed torques and replies as bytes
- properties: numbers of the controllers' properties by firmware
- safety_module: its modes, and what the pendant shows
"""
