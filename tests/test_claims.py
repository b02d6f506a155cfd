"""What the paper says, borne out by the elbow with the parameters that come with mjhill."""

import re
import subprocess
import sys
from functools import cache

import pytest

from mjhill import experiments

CLAIMS = {
    "synergists": [
        "sums the individual torques",
        "stronger muscles weigh more",
        "replace the synergists",
    ],
    "free_pulse": ["Superposition does not hold", "does not halve the times"],
    "neural_sinusoid": ["only below about 2 to 5 Hz", "depends on the amplitude"],
    "isovelocity": [
        "depend on the initial condition",
        "series element is the main cause",
    ],
    "isotonic": ["can be approximated once the dynamics of the limb are subtracted"],
    "step": ["faster at a higher excitation", "does not grow in proportion", "K and viscosity B"],
    "external_impulse": ["rise with co-contraction", "do not follow transients", "nonlinearity"],
    "spring_release": ["strong functions of co-contraction"],
    "external_sinusoid": ["bias torque the gain at low frequencies falls and the resonance"],
    "lengthening": ["plateau 30 % above isometric"],
    "tetanus": ["overdamped second-order", "electrical stimulation"],
}


@cache
def made(experiment):
    return getattr(experiments, experiment)("elbow")


@pytest.mark.parametrize("experiment", CLAIMS)
def test_people_read_degrees_and_words(experiment):
    angles = {"rad", "rad/s", "rad/(N·m)"}
    for measure in made(experiment).measures():
        assert measure.unit not in angles, measure
        assert not re.search("[a-z]_[a-z]", measure.name + measure.note)
    for claim in made(experiment).claims():
        assert not re.search(r"[a-z]_[a-z]|\d rad\b|rad/s|\bnan\b|\binf\b", claim.evidence)


@pytest.mark.parametrize("experiment", CLAIMS)
def test_the_elbow_bears_out_the_paper(experiment):
    claims = list(made(experiment).claims())
    for words in CLAIMS[experiment]:
        (claim,) = [claim for claim in claims if words in claim.sentence]
        assert claim.holds, claim.evidence
        assert any(character.isdigit() for character in claim.evidence)


@pytest.mark.parametrize("experiment", experiments.NAMES)
def test_every_experiment_refuses_a_joint_that_does_not_exist(experiment):
    with pytest.raises(ValueError, match="unknown joint 'toe'; there are: elbow"):
        getattr(experiments, experiment)("toe")


def test_an_experiment_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(AttributeError, match="no experiment 'sneeze'; there are: synergists"):
        experiments.sneeze  # noqa: B018


def test_experiments_are_functions_whatever_is_imported_before():
    code = "import mjhill\n" + "".join(
        f"import mjhill.experiments.{name}\n" for name in reversed(experiments.NAMES)
    )
    code += f"for name in {experiments.NAMES!r}: assert callable(getattr(mjhill.experiments, name))"
    subprocess.run([sys.executable, "-c", code], check=True)
