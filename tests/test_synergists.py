import pytest
from matplotlib.figure import Figure

import mjhill
from mjhill import experiments


def test_the_heads_and_their_equivalent_move_the_joint_alike():
    result = experiments.synergists("elbow")
    assert result.muscle in mjhill.JOINTS["elbow"].muscles
    torque = sum(head.max_isometric_force for head in result.heads.values())
    assert result.equivalent.max_isometric_force == pytest.approx(torque, rel=1e-3)
    assert result.with_heads.shape == result.with_equivalent.shape == result.time.shape
    # the extensor takes the joint the other way from flexion
    assert result.with_heads[-1] < result.with_heads[0] - 0.5
    assert result.with_heads == pytest.approx(result.with_equivalent, abs=0.02)
    assert all(claim.holds for claim in result.claims())


def test_the_figure_has_the_two_panels_of_the_paper():
    result, figure = experiments.synergists("elbow"), Figure()
    result.draw(figure)
    labels = [axis.get_xlabel() for axis in figure.axes]
    assert labels == ["shortening velocity [°/s]", "stretch [°]"]
    assert len(figure.axes[0].get_lines()) == len(result.heads) + 2


def test_a_joint_without_the_anatomy_is_refused():
    with pytest.raises(ValueError, match="synergists of 'knee'; there is one for: elbow"):
        experiments.synergists("knee")
