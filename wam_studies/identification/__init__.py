"""Identification of the controllers' model: the motion that shows the parameters, and how good the result is.

excitation  a scenario that moves the arm so that the parameters show
plants      plants that differ from the model, how their torques are measured, and their true parameters
study       identified against true friction over plants and seeds (`wam evaluate identify`)
"""
