"""The bench: a joint set up, held, driven and read."""
