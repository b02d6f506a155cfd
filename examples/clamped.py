"""Neural input to torque, the joint clamped: the twitch of the ankle and the tetanus of the elbow.

The joint sits in a dynamometer of finite stiffness; torque is read where a laboratory reads it.
"""

import sys

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mjhill import experiments


def main(path: str = "clamped.png") -> None:
    twitch = experiments.twitch("ankle")
    tetanus = experiments.tetanus("elbow")
    figure = Figure(figsize=(9, 8), layout="constrained")
    FigureCanvasAgg(figure)
    for part, result in zip(figure.subfigures(2, 1), (twitch, tetanus), strict=True):
        result.draw(part)
    figure.savefig(path, dpi=100)
    for result in (twitch, tetanus):
        for measure in result.measures():
            if "time to peak" in measure.name or "63 %" in measure.name:
                print(f"{measure.name}: {measure.value:.0f} {measure.unit}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
