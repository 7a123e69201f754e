"""The thesis's figures that carry data, chapters 3 to 6: numbers and drawings in modules apart."""
