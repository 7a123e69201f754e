"""Whole-arm tasks: what they show in numbers, with the truth from the simulator.

A task is `config/tasks/NAME.yaml`, of the form of an experiment; `wam demo --task NAME` plays it.

evaluations     each task's numbers
pictures        the arm and the objects at moments of a task
"""
