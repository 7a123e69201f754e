"""The commands of `wam`, a module each: `arguments(parser)` and `run(given)`, which returns the exit code."""
