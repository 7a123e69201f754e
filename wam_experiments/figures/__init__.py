"""The thesis's figures that carry data: theory as lines, points of the plant.

catalogue                 every figure: caption, function of its numbers, function that draws it
links                     numbers of figure 3.1
backdrivability           numbers of figure 3.2.6; drawing in backdrivability_drawing
bandwidth                 numbers of figure 4.9
responses                 numbers of figures 5.3, 5.5, 5.9, 5.10, 5.11
stability                 numbers of figures 5.7 and 5.8
friction_claims           numbers of figures 5.4, 5.5.1, 5.5.2, in words in print; drawings in friction_claim_drawings
cables                    numbers of the figures of chapter 6
transmission_drawings     drawings of chapters 3, 4 and 6
force_control_drawings    drawings of chapter 5
series                    a line with points, and their distance
style                     colours and sizes
"""
