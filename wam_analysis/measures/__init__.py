"""What can be measured in signals: pure functions of arrays, no bag and no ROS."""
