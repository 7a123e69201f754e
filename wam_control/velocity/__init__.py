"""The inner loop: motors and joints, velocity of each motor, gravity, dither.

======================  ================================================================================
``dither``              alternating motor torque against stiction, for contact detection at rest
``gravity_node``        the node
``position_loop``       in its place, on position: law and node, 2.1.2
``servo_guard``         which gains of the velocity loop are stable on the arm
``torque_loop``         in its place, on torque: law and node, 2.1.2
``transform``           motor states to joint states, joint commands to motor commands, (A.5)
``transform_node``      the node
``velocity_loop``       inner loop: PI control of each motor's velocity, torque feed-forward
``velocity_loop_node``  the node
======================  ================================================================================
"""
