"""A joint made for tests, whose truths do not depend on the parameter file."""

import mjhill

MUSCLE = mjhill.Hill(
    max_isometric_force=10.0,
    optimal_length=0.0,
    width_short=1.2,
    width_long=1.2,
    max_velocity=15.0,
    hill_shape=0.3,
    series_stretch=0.2,
    excitation_tau=0.03,
    activation_tau=0.01,
    deactivation_tau=0.04,
)


def make_joint(muscle: mjhill.Hill = MUSCLE, **changes) -> mjhill.Joint:
    values = {
        "name": "joint",
        "positive": "right",
        "inertia": 0.01,
        "damping": 0.05,
        "stiffness": 1.0,
        "rest_angle": 0.0,
        "passive": mjhill.Passive(k1_pos=0.5, k2_pos=2.0, k1_neg=0.25, k2_neg=2.0),
        "range": (-1.2, 1.2),
        "home_angle": 0.0,
        "muscles": {"puller": muscle, "opponent": muscle},
        "gears": {"puller": -1.0, "opponent": 1.0},
    }
    return mjhill.Joint(**{**values, **changes})
