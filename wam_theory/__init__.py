"""What the thesis predicts, as pure functions that cite their equations."""
