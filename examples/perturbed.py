"""External torque to movement: what co-contraction does to a hit, a release and an oscillation."""

import sys

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mjhill import experiments


def main(path: str = "perturbed.png") -> None:
    result = experiments.external_impulse("elbow", cocontraction=(0.02, 0.2, 0.5))
    figure = Figure(figsize=result.size, layout="constrained")
    FigureCanvasAgg(figure)
    result.draw(figure)
    figure.savefig(path, dpi=100)
    for measure in result.measures():
        if measure.value is not None and ("K" in measure.name or "peak" in measure.name):
            print(f"{measure.name}: {measure.value:.3g} {measure.unit}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
