"""MuJoCo's callbacks of the muscle, in plain Python and compiled from the same equations."""
