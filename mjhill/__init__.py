"""Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""

from typing import TYPE_CHECKING, Any

from mjhill import reference as reference
from mjhill.checks import check_model as check_model
from mjhill.energy import Energy as Energy
from mjhill.energy import energy as energy
from mjhill.equilibrium import at_home as at_home
from mjhill.equilibrium import equilibrate as equilibrate
from mjhill.equivalent import anatomical_muscle as anatomical_muscle
from mjhill.equivalent import equivalent_muscle as equivalent_muscle
from mjhill.install import install as install
from mjhill.install import installed as installed
from mjhill.install import installed_backend as installed_backend
from mjhill.install import uninstall as uninstall
from mjhill.joints import JOINTS as JOINTS
from mjhill.joints import read_joints as read_joints
from mjhill.layout import muscle_names as muscle_names
from mjhill.layout import read_muscle as read_muscle
from mjhill.layout import read_passive as read_passive
from mjhill.layout import write_muscle as write_muscle
from mjhill.layout import write_passive as write_passive
from mjhill.models import load as load
from mjhill.models import model_path as model_path
from mjhill.parameters import Joint as Joint
from mjhill.parameters import Muscle as Muscle
from mjhill.parameters import Passive as Passive
from mjhill.recording import Recording as Recording
from mjhill.run import record as record
from mjhill.signals import Signal as Signal
from mjhill.signals import constant as constant
from mjhill.signals import pulse as pulse
from mjhill.signals import sinusoid as sinusoid
from mjhill.signals import step as step
from mjhill.spec import add_muscle as add_muscle
from mjhill.spec import add_passive as add_passive
from mjhill.tendons import check_tendons as check_tendons
from mjhill.transients import Transient as Transient
from mjhill.transients import transients as transients

if TYPE_CHECKING:
    from mjhill.rendering import View as View
    from mjhill.rendering import draw_muscles as draw_muscles
    from mjhill.rendering import render as render
    from mjhill.rendering import snapshot as snapshot
    from mjhill.rendering import view as view

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """What draws is loaded when it is asked for: ``import mujoco`` loads this package too."""
    if name in ("View", "draw_muscles", "render", "snapshot", "view"):
        from mjhill import rendering

        return getattr(rendering, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
