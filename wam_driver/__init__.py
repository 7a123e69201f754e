"""The motor side: MuJoCo plant, amplifier and motor limits, safety, and the driver node."""
