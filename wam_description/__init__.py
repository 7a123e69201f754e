"""What the arm is: constants, parameters, transmission map, kinematics, MJCF and URDF."""
