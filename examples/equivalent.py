"""The triceps as one muscle: three heads and their equivalent, as the paper's Fig. 3.

Forces and lengths are those of OpenSim's Arm26 (Holzbaur et al. 2005); the moment arm, the fibre
speed and the angle of the optimum are estimates, fast fibres after Johnson et al. 1973.
"""

import sys
from typing import Any

import numpy as np
from matplotlib.axes import Axes
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
# blue, orange, green of Okabe & Ito 2008; the last two heads have one torque and speed
STYLES = (("#0072b2", "-"), ("#e69f00", "-"), ("#009e73", (0, (3, 2))))


def head(force: float, fibre: float, tendon: float, pennation: float) -> mjhill.Muscle:
    return mjhill.anatomical_muscle(
        max_force=force, fibre_length=fibre, tendon_length=tendon, pennation=pennation, **COMMON
    )


def main(path: str = "equivalent.png") -> None:
    muscles = {name: head(*values) for name, values in HEADS.items()}
    equivalent = mjhill.equivalent_muscle(list(muscles.values()))
    figure = Figure(figsize=(9, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    speed_axis, stretch_axis = figure.subplots(1, 2, sharey=True)
    for (name, muscle), (colour, dashes) in zip(muscles.items(), STYLES, strict=True):
        draw(speed_axis, stretch_axis, muscle, label=name, color=colour, linestyle=dashes)
    draw(speed_axis, stretch_axis, equivalent, label="equivalent muscle", color="black")
    speeds = np.linspace(0, max(muscle.max_velocity for muscle in muscles.values()), 16)
    total = torque_at_velocity(list(muscles.values()), speeds)
    speed_axis.plot(
        speeds, total, "o", color="0.45", markersize=5, label="sum of heads", clip_on=False
    )
    speed_axis.set_title("(a) torque and velocity", fontsize=14)
    speed_axis.set_xlabel("shortening velocity [rad/s]", fontsize=13)
    speed_axis.set_ylabel("torque [N·m]", fontsize=13)
    stretch_axis.set_title("(b) series elements", fontsize=14)
    stretch_axis.set_xlabel("stretch [°]", fontsize=13)
    for axis in (speed_axis, stretch_axis):
        axis.grid(color="0.9", linewidth=0.8)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=12)
        axis.set(xlim=(0, None), ylim=(0, None))
    spacing = {"columnspacing": 1.2, "handlelength": 1.5, "handletextpad": 0.5}
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=11.5, **spacing)
    figure.savefig(path, dpi=110)
    print(f"equivalent: {equivalent.max_isometric_force:.1f} N·m", end=", ")
    print(f"V_max {equivalent.max_velocity:.1f} rad/s, A {equivalent.hill_shape:.2f}", end=", ")
    print(f"stretch {np.degrees(equivalent.series_stretch):.0f}° at full force")


def draw(speed_axis: Axes, stretch_axis: Axes, muscle: mjhill.Muscle, **style: Any) -> None:
    speeds, shares = np.linspace(0, muscle.max_velocity, 200), np.linspace(0, 1, 100)
    speed_axis.plot(speeds, torque_at_velocity([muscle], speeds), linewidth=2.2, **style)
    stretch, torque = stretch_at_force(muscle, shares), shares * muscle.max_isometric_force
    stretch_axis.plot(np.degrees(stretch), torque, linewidth=2.2, **{**style, "label": None})


if __name__ == "__main__":
    main(*sys.argv[1:2])
