"""Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""

from importlib import import_module
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
from mjhill.muscles.dm import DistributionMoment as DistributionMoment
from mjhill.muscles.equivalent import anatomical_muscle as anatomical_muscle
from mjhill.muscles.equivalent import equivalent_muscle as equivalent_muscle
from mjhill.muscles.hill import Hill as Hill
from mjhill.muscles.hill_linear import HillLinear as HillLinear
from mjhill.muscles.hill_rigid import HillRigid as HillRigid
from mjhill.muscles.huxley import Huxley as Huxley
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
    from mjhill import experiments as experiments
    from mjhill.comparison import compare as compare
    from mjhill.draw import View as View
    from mjhill.draw import draw_muscles as draw_muscles
    from mjhill.draw import frames as frames
    from mjhill.draw import render as render
    from mjhill.draw import snapshot as snapshot
    from mjhill.draw import view as view
    from mjhill.draw.plot import plot_recording
    from mjhill.identification import identify as identify

    plot = plot_recording

__version__ = "0.1.0"

# loaded when they are asked for, because ``import mujoco`` loads this package: module and name
_LATER = {
    "View": ("mjhill.draw", "View"),
    "compare": ("mjhill.comparison", "compare"),
    "draw_muscles": ("mjhill.draw", "draw_muscles"),
    "experiments": ("mjhill.experiments", ""),
    "frames": ("mjhill.draw", "frames"),
    "identify": ("mjhill.identification", "identify"),
    "plot": ("mjhill.draw.plot", "plot_recording"),
    "render": ("mjhill.draw", "render"),
    "snapshot": ("mjhill.draw", "snapshot"),
    "view": ("mjhill.draw", "view"),
}


def __getattr__(name: str) -> Any:
    """What draws, experiments and fits, loaded at its first use."""
    if name in _LATER:
        module, attribute = _LATER[name]
        loaded = import_module(module)
        return getattr(loaded, attribute) if attribute else loaded
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, those too that are loaded later."""
    return sorted({*globals(), *_LATER})
