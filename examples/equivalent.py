"""The triceps as one muscle: three heads and their equivalent, as the paper's Fig. 3.

Forces and lengths are those of OpenSim's Arm26 (Holzbaur et al. 2005); their sources are in
mjhill/literature/synergists.toml.
"""

import sys

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mjhill import experiments


def main(path: str = "equivalent.png") -> None:
    result = experiments.synergists("elbow")
    figure = Figure(figsize=result.size, layout="constrained")
    FigureCanvasAgg(figure)
    result.draw(figure)
    figure.savefig(path, dpi=110)
    for measure in result.measures():
        if measure.name.startswith("equivalent"):
            print(f"{measure.name} {measure.value:.4g} {measure.unit}")
    for claim in result.claims():
        print(claim.sentence, claim.evidence)


if __name__ == "__main__":
    main(*sys.argv[1:2])
