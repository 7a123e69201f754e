"""The thesis's figures that carry data: theory as lines, points of the plant.

catalogue         every figure: function of its panels
panels            a figure as data: panels of lines with points, their distance; draws them all
conditions        loads, steps, poses and frictions of every figure
transmissions     figure 1.1 and its table: cables, shaft and gears, direct drive
open_loop         figure 2.1.1: force without feedback over the workspace, feed-forward
inner_loops       figure 2.1.2: loops on torque, and on velocity or position
backdrivability   figure 3.2.6
closed_forms      figures 3.1 and 4.3 to 4.9, those of chapter 6
responses         figures 5.3, 5.5, 5.9, 5.10, 5.11
stability         figures 5.7 and 5.8; the bound of 5.8 with a loop on it
style             colours and sizes
"""
