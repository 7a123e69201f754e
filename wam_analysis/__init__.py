"""From recordings to numbers and pictures, and runs without ROS."""
