"""What `wam analyse` finds in a recording, in words, numbers and pictures."""
