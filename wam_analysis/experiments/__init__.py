"""The experiments of the thesis on recorded runs: what was recorded beside what was predicted."""
