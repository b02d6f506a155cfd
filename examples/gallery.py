"""Every joint that comes with mjhill, moved by one of its muscles, in one picture."""

import math
import sys

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import mjhill

LEVEL = 0.8  # input [-]
DURATION = 0.2  # [s]
COLUMNS = 4


def pose(name: str) -> tuple[object, str]:
    """A joint at the end of a step of input of its first muscle, and a caption."""
    model, joint = mjhill.load(name), mjhill.JOINTS[name]
    data = mjhill.at_home(model)
    muscle = next(iter(joint.muscles))
    with mjhill.installed():
        run = mjhill.record(model, data, duration=DURATION, excitation={muscle: LEVEL})
    angle = math.degrees(run[f"{name}.angle"][-1])
    image = mjhill.snapshot(model, run, time=DURATION, size=(480, 400))
    return image, f"{name.replace('_', ' ')}: {angle:.0f}° {joint.positive}"


def main(path: str = "joints.png") -> None:
    rows = -(-len(mjhill.JOINTS) // COLUMNS)
    figure = Figure(figsize=(3 * COLUMNS, 2.8 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axis in axes:
        axis.set_axis_off()
    for axis, name in zip(axes, mjhill.JOINTS, strict=False):
        image, caption = pose(name)
        axis.imshow(image)
        axis.set_title(caption, fontsize=12)
        print(caption)
    figure.savefig(path, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:2])
