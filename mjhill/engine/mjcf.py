"""Parameters as MJCF: ``models/<joint>/parameters.xml``, and snippets for other models.

``python -m mjhill.engine.mjcf FOLDER`` writes the file of every joint that has a folder there.
"""

from __future__ import annotations

import re
import sys
import textwrap
from pathlib import Path
from xml.sax.saxutils import escape

import mujoco
import numpy as np

from mjhill.engine.layout import (
    NUSER_JNT,
    addresses,
    elastic_joints,
    parameter_rows,
    passive_row,
    read_muscle,
    read_passive,
)
from mjhill.files import replacing
from mjhill.joints.joint import Joint
from mjhill.joints.reader import JOINTS
from mjhill.muscles import MuscleModel, model_of, steady_states
from mjhill.quantity import quantities

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
{slots}
      Each actuator gives its lengthrange, or the compiler would search for it by simulation.
    -->
    <default class="{joint}_muscle">
      <general dyntype="user" gaintype="fixed" biastype="user" ctrllimited="true" ctrlrange="0 1"/>
    </default>
  </default>

  <actuator>
"""
_MUSCLE = """    <general name="{name}" class="{joint}_muscle" joint="{joint}" gear="{gear}"
      actdim="{states}" lengthrange="-1 1"
      dynprm="{dynprm}"
      gainprm="{gainprm}"
      biasprm="{biasprm}"/>
"""
_TAIL = """  </actuator>

  <keyframe>
    <!-- still, muscles at rest: the states of each -->
    <key name="home" qpos="{home}" act="{act}"/>
  </keyframe>
</mujocoinclude>
"""


def parameters_xml(joint: Joint) -> str:
    """An MJCF include with the classes, actuators and ``home`` key of a joint.

    The joint itself takes the class ``<joint>_plant``; its inertia is that of the bodies.
    """
    kinds = dict.fromkeys(model_of(muscle) for muscle in joint.muscles.values())
    head = _HEAD.format(
        nuser=NUSER_JNT,
        joint=joint.name,
        damping=_text([joint.damping]),
        stiffness=_text([joint.stiffness]),
        rest=_text([joint.rest_angle]),
        passive=_text(passive_row(joint.passive)),
        slots="\n".join(_slot_table(kind) for kind in kinds),
    )
    muscles, act = "", []
    for name, muscle in joint.muscles.items():
        gear = joint.gears[name]
        rows = {array: _text(row) for array, row in parameter_rows(muscle).items()}
        states = model_of(muscle).state_count(muscle)
        muscles += _MUSCLE.format(
            name=name, joint=joint.name, gear=_text([gear]), states=states, **rows
        )
        length = gear * joint.home_angle
        act += steady_states(muscle, 0.0, length)
    return head + muscles + _TAIL.format(home=_text([joint.home_angle]), act=_text(act))


def _slot_table(kind: MuscleModel) -> str:
    """A comment that says what the numbers of a muscle model's rows are."""
    units = {name: quantity.units[0] for name, quantity in quantities(kind.parameters)}
    rows: dict[str, list[str]] = {"dynprm": ["0 tag"], "gainprm": ["0 always 0"], "biasprm": []}
    for name, (array, slot) in kind.slots.items():
        unit = f" [{units[name]}]" if name in units else ""
        rows[array].append(f"{slot} {name}{unit}")
    lines = [f"      Slots of the muscle model {kind.name}:"]
    for array, entries in rows.items():
        # no break between a number and its name
        wrapped = textwrap.wrap(", ".join(entry.replace(" ", "\xa0") for entry in entries), 80)
        lines += [f"      {array if k == 0 else '':8} {line}" for k, line in enumerate(wrapped)]
    return "\n".join(lines).replace("\xa0", " ")


def snippet(loaded: mujoco.MjModel) -> str:
    """The elements of a model that hold parameters, for pasting into another model's file."""
    lines = []
    for name, _ in elastic_joints(loaded):
        row = passive_row(read_passive(loaded, name))
        lines.append(f'<joint name={_quoted(name)} user="{_text(row)}"/>')
    for name, at in addresses(loaded):
        muscle = read_muscle(loaded, name)
        rows = parameter_rows(muscle)
        gear = f"{loaded.actuator_gear[at.out, 0]:g}"
        lines += [
            f'<general name={_quoted(name)} gear="{gear}" dyntype="user"',
            f'  actdim="{at.model.state_count(muscle)}" gaintype="fixed" biastype="user"',
            '  ctrlrange="0 1" lengthrange="-1 1"',
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
