"""The joint side: transform, gravity, velocity and force loops, contact estimation; each law beside its node."""
