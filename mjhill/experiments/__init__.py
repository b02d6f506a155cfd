"""Experiments on a joint: what a laboratory does to it, done to its model."""
