"""Runs: inputs over time, recordings, and the reference solution."""
