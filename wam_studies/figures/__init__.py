"""The thesis's figures that carry data: theory as lines, points of the plant.

catalogue                 every figure: caption, function of its numbers, function that draws it
transmissions             numbers of figure 1.1 and its table: cables, shaft and gears, direct drive
open_loop                 numbers of figure 2.1.1: force without feedback over the workspace, feed-forward
inner_loops               numbers of figure 2.1.2: loops on torque, and on velocity or position
links                     numbers of figure 3.1
backdrivability           figure 3.2.6
conditions                loads, steps, poses and frictions of every figure
reducer                   numbers of figures 4.3 to 4.7
bandwidth                 numbers of figure 4.9
responses                 numbers of figures 5.3, 5.5, 5.9, 5.10, 5.11
stability                 numbers of figures 5.7 and 5.8
friction_claims           numbers of figures 5.4, 5.5.1, 5.5.2, in words in print; drawings in friction_claim_drawings
cables                    numbers of the figures of chapter 6
transmission_drawings     drawings of chapters 3, 4 and 6
force_control_drawings    drawings of chapter 5
panels                    a figure as data: panels of lines with points; draws figures 1.1, 2.1.1, 2.1.2, 4.5
series                    a line with points, and their distance
sweeps                    results of `wam sweep` over each parameter
style                     colours and sizes
"""
