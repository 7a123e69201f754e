"""Identification of the controllers' model: the motion that shows the parameters, and how good the result is.

excitation  a scenario that moves the arm so that the parameters show
signals     how the torques of the motors are measured
plants      plants that differ from the model, and their true parameters
evaluation  identified against true parameters over plants and seeds, as a page
"""
