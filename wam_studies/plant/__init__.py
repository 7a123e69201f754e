"""The plant's effects, each measured alone on an ideal testbed and compared with theory.

ideal_testbed    one link on one cable circuit, with the requested effects only; the force loop of figure 5.4 around it
effects          loss, impact and cycles of the plant and of theory, and their table
"""
