"""Runs: inputs over time, the recording of what came of them, and the reference solution."""
