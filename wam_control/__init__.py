"""The joint side: force control and contact estimation, as plain classes with ``step(..., dt)``.

Modules ``*_node`` declare the nodes: inputs, outputs and steps.

==============  ==============================================================================
``velocity``    the inner loop: transform, velocity of each motor, gravity, dither
``force``       the outer loop: forces, tasks, and the guard of its stability
``contact``     what touches the arm: external torques, contact positions, tracked model errors
``task``        motion over time: trajectories, and scenarios of steps
``thresholds``  when the arm is at rest or at a goal; which gains of the inner loop are accepted
==============  ==============================================================================
"""
