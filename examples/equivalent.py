"""The triceps as one muscle: three heads and their equivalent, as the paper's Fig. 3.

Forces and lengths are those of OpenSim's Arm26 (Holzbaur et al. 2005); the moment arm, the fibre
speed and the angle of the optimum are estimates, fast fibres after Johnson et al. 1973.
"""

import sys

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import mjhill
from mjhill.equivalent import stretch_at_force, torque_at_velocity

COMMON = {"moment_arm": 0.02, "optimal_length": 0.8, "fast_fibres": 0.67, "fibre_speed": 5.0}
HEADS = {  # force [N], fibre and tendon length [m], pennation [rad]
    "long head": (798.5, 0.134, 0.143, 0.209),
    "lateral head": (624.3, 0.1138, 0.098, 0.157),
    "medial head": (624.3, 0.1138, 0.0908, 0.157),
}


def head(force: float, fibre: float, tendon: float, pennation: float) -> mjhill.Muscle:
    return mjhill.anatomical_muscle(
        max_force=force, fibre_length=fibre, tendon_length=tendon, pennation=pennation, **COMMON
    )


def main(path: str = "triceps.png") -> None:
    muscles = {name: head(*values) for name, values in HEADS.items()}
    both = {**muscles, "equivalent": mjhill.equivalent_muscle(list(muscles.values()))}
    velocities, shares = np.linspace(0, 35, 200), np.linspace(0, 1, 100)
    figure = Figure(figsize=(9, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    speed_axis, stretch_axis = figure.subplots(1, 2)
    for name, muscle in both.items():
        style = {"color": "black", "linewidth": 2.2} if name == "equivalent" else {}
        torque = torque_at_velocity([muscle], velocities)
        speed_axis.plot(velocities, torque, label=name, **style)
        stretch = np.degrees(stretch_at_force(muscle, shares))
        stretch_axis.plot(stretch, shares * muscle.max_isometric_force, **style)
    speed_axis.set(xlabel="shortening velocity [rad/s]", ylabel="torque [N·m]")
    stretch_axis.set(xlabel="stretch of the series element [°]", ylabel="torque [N·m]")
    speed_axis.legend(frameon=False)
    figure.savefig(path, dpi=110)
    equivalent = both["equivalent"]
    print(f"equivalent: {equivalent.max_isometric_force:.1f} N·m", end=", ")
    print(f"V_max {equivalent.max_velocity:.1f} rad/s, A {equivalent.hill_shape:.2f}", end=", ")
    print(f"stretch {np.degrees(equivalent.series_stretch):.0f}° at full force")


if __name__ == "__main__":
    main(*sys.argv[1:2])
