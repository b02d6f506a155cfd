"""Parameters as MJCF: ``models/<joint>/parameters.xml``, and snippets for other models.

``python -m mjhill.engine.mjcf FOLDER`` writes the file of every joint that has a folder there.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from mjhill.cli.describe import elastic_joints
from mjhill.engine.layout import (
    NUSER_JNT,
    STATES,
    addresses,
    parameter_rows,
    passive_row,
    read_muscle,
    read_passive,
)
from mjhill.files import replacing
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.muscles.readings import steady_stretch
from mjhill.simulate.load import load

# what a terminal acts upon, or an XML reader takes for a space
_HIDDEN = re.compile("[\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f]")
_HEAD = """<mujocoinclude>
  <!-- Made from mjhill/joints/joints.toml, which has the sources, by `make models`. -->
  <size nuser_jnt="{nuser}"/>

  <default>
    <default class="{joint}_plant">
      <!-- user: tag, k1 and k2 of the positive side, of the negative side, exponent limit -->
      <joint damping="{damping}" stiffness="{stiffness}" springref="{rest}" user="{passive}"/>
    </default>
    <!--
      Slots of mjhill's muscle:
      dynprm   0 tag                  1 excitation_tau [s]         2 activation_tau [s]
               3 deactivation_tau [s] 4 electrical_stimulation     5 activation_floor [-]
      gainprm  0 always 0             1 max_isometric_force [N m]  2 optimal_length [rad]
               3 width_short [rad]    4 width_long [rad]           5 series_stretch [rad]
               6 series_shape [-]     7 series_limit [-]
      biasprm  0 max_velocity [rad/s] 1 hill_shape [-]             2 eccentric_plateau [-]
               3 eccentric_slope_ratio [-] 4 viscosity [-]         5 velocity_activation [-]
      Each actuator gives its lengthrange, or the compiler would search for it by simulation.
    -->
    <default class="{joint}_muscle">
      <general dyntype="user" actdim="{states}" gaintype="fixed" biastype="user"
        ctrllimited="true" ctrlrange="0 1"/>
    </default>
  </default>

  <actuator>
"""
_MUSCLE = """    <general name="{name}" class="{joint}_muscle" joint="{joint}" gear="{gear}"
      lengthrange="-1 1"
      dynprm="{dynprm}"
      gainprm="{gainprm}"
      biasprm="{biasprm}"/>
"""
_TAIL = """  </actuator>

  <keyframe>
    <!-- still, both muscles at rest: n, a, s of each -->
    <key name="home" qpos="{home}" act="{act}"/>
  </keyframe>
</mujocoinclude>
"""


def parameters_xml(joint: Joint) -> str:
    """An MJCF include with the classes, actuators and ``home`` key of a joint.

    The joint itself takes the class ``<joint>_plant``; its inertia is that of the bodies.
    """
    head = _HEAD.format(
        nuser=NUSER_JNT,
        joint=joint.name,
        damping=_text([joint.damping]),
        stiffness=_text([joint.stiffness]),
        rest=_text([joint.rest_angle]),
        passive=_text(passive_row(joint.passive)),
        states=STATES,
    )
    muscles, act = "", []
    for name, muscle in joint.muscles.items():
        gear = joint.gears[name]
        rows = {array: _text(row) for array, row in parameter_rows(muscle).items()}
        muscles += _MUSCLE.format(name=name, joint=joint.name, gear=_text([gear]), **rows)
        length = gear * joint.home_angle
        act += [0.0, 0.0, length - steady_stretch(muscle, 0.0, length)]
    return head + muscles + _TAIL.format(home=_text([joint.home_angle]), act=_text(act))


def snippet(model: str | Path) -> str:
    """The elements of a joint's model or a file that hold parameters, for pasting into another.

    Raises:
        ValueError: As ``load``.
    """
    loaded = load(model)
    lines = []
    for name, _ in elastic_joints(loaded):
        row = passive_row(read_passive(loaded, name))
        lines.append(f'<joint name={_quoted(name)} user="{_text(row)}"/>')
    for name, at in addresses(loaded):
        rows = parameter_rows(read_muscle(loaded, name))
        gear = f"{loaded.actuator_gear[at.out, 0]:g}"
        lines += [
            f'<general name={_quoted(name)} gear="{gear}" dyntype="user"',
            f'  actdim="{STATES}" gaintype="fixed" biastype="user" ctrlrange="0 1"',
            '  lengthrange="-1 1"',
            *(f'  {array}="{_text(row)}"' for array, row in rows.items()),
        ]
        lines[-1] += "/>"
    return "\n".join(lines)


def _quoted(text: str) -> str:
    """A value of an XML attribute with its quotes; control characters become references."""
    escaped = escape(text, {'"': "&quot;"})
    return f'"{_HIDDEN.sub(lambda found: f"&#{ord(found[0])};", escaped)}"'


def write_parameters(folder: Path) -> list[Path]:
    """Write ``parameters.xml`` of every joint that has a folder in ``folder``."""
    written = []
    for name, joint in JOINTS.items():
        if (folder / name).is_dir():
            with replacing(folder / name / "parameters.xml") as partial:
                partial.write_text(parameters_xml(joint), encoding="utf-8")
            written.append(folder / name / "parameters.xml")
    return written


def _text(numbers: object) -> str:
    """Shortest exact decimals, trailing zeros of a row left out as MJCF allows."""
    values = np.trim_zeros(np.asarray(numbers, dtype=float), "b").tolist() or [0.0]
    return " ".join(repr(value).removesuffix(".0") for value in values)


if __name__ == "__main__":
    for path in write_parameters(Path(sys.argv[1])):
        print(path)
