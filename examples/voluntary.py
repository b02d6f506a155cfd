"""Neural input to movement: pulses that do not add up, and the agonist's and antagonist's bursts.

Twice the neural energy gives neither twice the velocity nor twice the amplitude.
"""

import sys

import mjhill
from mjhill import experiments


def main(path: str = "voluntary.mp4") -> None:
    result = experiments.free_pulse("elbow")
    for claim in result.claims():
        verdict = {True: "holds", False: "does not hold", None: "not decided"}[claim.holds]
        print(f"{verdict}: {claim.sentence} {claim.evidence}")
    film = result.film()
    assert film is not None
    mjhill.render(mjhill.View(mjhill.load("elbow"), film), path, size=(640, 360), speed=0.5)
    velocity = film["elbow.velocity"].max()
    print(f"{path}: three bursts, peak velocity {velocity:.1f} rad/s")


if __name__ == "__main__":
    main(*sys.argv[1:2])
