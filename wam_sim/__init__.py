"""The whole stack in one Python process without ROS: simulation, replay of recordings, batches.

- simulation: the nodes of a configuration around the simulated arm, in lockstep
- bus: topics of a simulation or a replay, and what was published on them
- simulated_bag: a simulation recorded as the recorder node records the nodes
- recorded_run, recorded_parameters: a recorded run, its steps, faults and parameters, read from a bag
- recorded_commands: the commands of a bag as the stack took them; whether a bag has several runs
- reactions: what the force loop did instead of what was commanded, and whether a step was carried out
- replay: recorded inputs through a node again, its outputs compared with the recorded ones
- batch: one function over many inputs on any executor; pieces: its finished results on disk
- sweep: parameter sets: every combination, a list, or drawn at random
- progress: how far a long computation is, for a terminal
"""
