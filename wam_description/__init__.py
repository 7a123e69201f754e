"""The arm as data: constants, parameters, kinematics and models, and the topics that the nodes share.

- constants: every number of the arm and the testbed, as printed or assumed
- units: conversion to SI; number_text: numbers as messages write them
- parameters: parameter classes with unit, range and meaning, and their checks
- configuration, yaml_text: parameter files, which may build on one another
- arm: parameters that every node shares; parts: those of motors, joints and links
- model: what the controllers know of the arm, where it is not the arm's own parameters
- cables, effects, mismatch: parameters of the cables, of further effects of the plant, of model mismatch
- world: parameters of what the arm can touch
- movable: parameters of what the arm can move, and of what moves by itself
- transmission_map: motors to joints and back, (A.5)
- small_matrices: rotations, products of small vectors, the inverse of a matrix
- rigid_body: kinematics and dynamics of the links
- mjcf, urdf: the arm as a model for MuJoCo and for ROS; xml_element: their numbers
- mjcf_objects: free bodies and doors in the model for MuJoCo
- contact_pairs: what may touch what, and the law of each contact force
- wiring, synchroniser: declaration of a node; its inputs brought together by stamp
- message_bus: who takes the messages of a topic, and when
- driver_contract: what a driver of the arm promises, row by row
- nodes, topics, interface: table of nodes, table of topics, who publishes and takes each topic
- signals, status: the values that nodes exchange; the status of a node
- thresholds: how exact the numbers of an arm are, and numbers of a model without effect
- event, event_text: what happened, as a code with values; its sentence; reasons: codes of an uncertain estimate
- agreement: whether nodes that were started apart have the same shared parameters
- defects: what makes such a value unusable, in a message and in what a node returns
"""
