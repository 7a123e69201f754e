"""Recordings of other robots read: JointState, WrenchStamped and mapped topics, by joint and wrench axis.

topic_map   which topics, joints and fields hold which quantity, in which unit
reading     bags by `wam_bag`, and those of other formats by rosbags, as columns of joints and wrenches
sources     one joint or one wrench of one sender: gaps, doubled stamps and lacking velocities handled
"""
