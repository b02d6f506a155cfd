"""Joints: an inertia, a passive elasticity and the muscles that move it."""
