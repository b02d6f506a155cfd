import re
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.bench import accuracy
from mjhill.cli import main
from mjhill.layout import SLOTS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
MODELS = [
    path.read_text(encoding="utf-8") for path in sorted((ROOT / "models").glob("*/README.md"))
]


def blocks(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


COMMANDS = [
    line.partition("#")[0].split()[1:]
    for block in blocks(README, "sh")
    for line in block.splitlines()
    if line.startswith("mjhill ")
]


@pytest.mark.parametrize(
    "snippet", [block for text in (README, *MODELS) for block in blocks(text, "python")]
)
def test_every_python_snippet_runs(snippet):
    run = subprocess.run(
        [sys.executable, "-c", snippet], check=False, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_every_command_runs(arguments):
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output


def test_there_are_snippets_of_each_kind():
    assert len(blocks(README, "python")) >= 3
    assert len(COMMANDS) >= 5


def test_the_mjcf_snippet_is_a_model_in_order():
    (xml,) = blocks(README, "xml")
    model = mujoco.MjModel.from_xml_string(xml)
    mjhill.check_model(model)
    joint = mjhill.JOINTS["elbow"]
    assert mjhill.read_muscle(model, "flexor") == joint.muscles["elbow_flexor"]
    assert mjhill.read_passive(model, "elbow") == joint.passive


def test_the_parameter_table_is_the_slot_table():
    rows = re.findall(r"^\| `(\w+)\[(\d+)\]`(?:, `\[(\d+)\]`)? \| (.*?) \|", README, re.MULTILINE)
    found = {}
    for array, first, second, names in rows:
        slots = [int(first)] + ([int(second)] if second else [])
        for slot, name in zip(slots, re.findall(r"`(\w+)`", names), strict=False):
            found[name] = (array, slot)
    assert found == SLOTS


def test_the_accuracy_table_is_what_the_benchmark_measures():
    (table,) = re.findall(r"<!-- accuracy.*?-->\n(.*?)<!-- end -->", README, re.DOTALL)
    written = [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]
    measured = accuracy.brief()
    assert [row[0] for row in written] == [row[0] for row in measured]
    for row, (_, *errors) in zip(written, measured, strict=True):
        # written with two digits; the smallest, RK4's, depend on the last bits of the reference
        assert [float(cell) for cell in row[1:]] == pytest.approx(errors, rel=0.1, abs=2e-5)
