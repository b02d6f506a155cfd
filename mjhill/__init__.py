"""Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""

from typing import TYPE_CHECKING, Any

from mjhill.engine.checks import check_model as check_model
from mjhill.engine.equilibrium import at_home as at_home
from mjhill.engine.equilibrium import equilibrate as equilibrate
from mjhill.engine.install import install as install
from mjhill.engine.install import installed as installed
from mjhill.engine.install import installed_backend as installed_backend
from mjhill.engine.install import uninstall as uninstall
from mjhill.engine.layout import muscle_names as muscle_names
from mjhill.engine.layout import read_muscle as read_muscle
from mjhill.engine.layout import read_passive as read_passive
from mjhill.engine.layout import write_muscle as write_muscle
from mjhill.engine.layout import write_passive as write_passive
from mjhill.engine.spec import add_muscle as add_muscle
from mjhill.engine.spec import add_passive as add_passive
from mjhill.engine.tendons import check_tendons as check_tendons
from mjhill.joints.joint import Joint as Joint
from mjhill.joints.joint import Passive as Passive
from mjhill.joints.reader import JOINTS as JOINTS
from mjhill.joints.reader import read_joints as read_joints
from mjhill.muscles import MODELS as MODELS
from mjhill.muscles import Muscle as Muscle
from mjhill.muscles import muscle_model as muscle_model
from mjhill.muscles import readings as readings
from mjhill.muscles.equivalent import anatomical_muscle as anatomical_muscle
from mjhill.muscles.equivalent import equivalent_muscle as equivalent_muscle
from mjhill.muscles.hill import Hill as Hill
from mjhill.muscles.hill_rigid import HillRigid as HillRigid
from mjhill.simulate import reference as reference
from mjhill.simulate.energy import Energy as Energy
from mjhill.simulate.energy import energy as energy
from mjhill.simulate.load import load as load
from mjhill.simulate.load import model_path as model_path
from mjhill.simulate.recording import Recording as Recording
from mjhill.simulate.run import record as record
from mjhill.simulate.signals import Signal as Signal
from mjhill.simulate.signals import constant as constant
from mjhill.simulate.signals import pulse as pulse
from mjhill.simulate.signals import sinusoid as sinusoid
from mjhill.simulate.signals import step as step
from mjhill.simulate.transients import Transient as Transient
from mjhill.simulate.transients import transients as transients

if TYPE_CHECKING:
    from mjhill.draw import View as View
    from mjhill.draw import draw_muscles as draw_muscles
    from mjhill.draw import render as render
    from mjhill.draw import snapshot as snapshot
    from mjhill.draw import view as view

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """What draws is loaded when it is asked for: ``import mujoco`` loads this package too."""
    if name in ("View", "draw_muscles", "render", "snapshot", "view"):
        from mjhill import draw as rendering

        return getattr(rendering, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
