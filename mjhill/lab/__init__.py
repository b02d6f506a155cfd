"""The laboratory: a joint on a rig, many rigs at once, and the machines that act on it."""
