"""Muscles in MuJoCo: where they live in a model, what is checked, and the callbacks."""
