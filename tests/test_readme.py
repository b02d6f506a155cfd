import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import mujoco
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.benchmarks import accuracy
from mjhill.cli import main
from mjhill.identification.facts import facts
from mjhill.identification.free import free_parameters, value_of
from mjhill.identification.rows import brief, published_rows

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {
    path.stem: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md"))
}
MODELS = [
    path.read_text(encoding="utf-8") for path in sorted((ROOT / "models").glob("*/README.md"))
]


def blocks(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


COMMANDS = [
    line.partition("#")[0].split()[1:]
    for page in (README, *PAGES.values())
    for block in blocks(page, "sh")
    for line in block.splitlines()
    if line.startswith("mjhill ")
]


SNIPPETS = [
    block
    for text in (README, *PAGES.values(), *MODELS)
    for block in blocks(text, "python")
    if "mujoco.viewer" not in block  # needs a screen; test_viewer has one
]


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_every_python_snippet_runs(snippet):
    users = {k: v for k, v in os.environ.items() if k != "MJHILL_AUTOLOAD"}
    run = subprocess.run(
        [sys.executable, "-c", snippet], check=False, capture_output=True, text=True, env=users
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    "arguments",
    [c for c in COMMANDS if c not in (["identify", "elbow"], ["view", "elbow"])],
    ids=" ".join,
)
def test_every_command_runs(arguments):
    # after those that write what it reads
    makers = [c for c in COMMANDS[: COMMANDS.index(arguments)] if set(outputs(c)) & set(arguments)]
    for command in [*makers, arguments]:
        result = CliRunner().invoke(main, command)
        assert result.exit_code == 0, result.output


def test_identify_gives_the_shipped_values_of_the_elbow_again():
    """The fit of the other joints is tested in test_literature; the elbow's takes long."""
    command = ["identify", "elbow"]
    assert command in COMMANDS
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0, result.output
    fitted = mjhill.read_joints("out/identify/joints.toml")["elbow"]
    shipped = mjhill.JOINTS["elbow"]
    for free in free_parameters("elbow"):
        # the file keeps four digits, and processors differ in the last bits of a run
        assert value_of(fitted, free) == pytest.approx(value_of(shipped, free), rel=2e-3)


def outputs(command):
    return [value for option, value in pairwise(command) if option == "--output"]


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 180


def test_links_lead_somewhere():
    for folder, page in ((ROOT, README), *((ROOT / "docs", page) for page in PAGES.values())):
        for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)|src=\"([^\"]+)\"", page):
            (path,) = filter(None, target)
            if "://" not in path:
                assert (folder / path).exists(), path


def test_there_are_snippets_of_each_kind():
    assert len(blocks(README, "python")) >= 3
    assert len(COMMANDS) >= 5


def test_the_mjcf_snippet_is_a_model_in_order():
    (xml,) = blocks(PAGES["muscle"], "xml")
    model = mujoco.MjModel.from_xml_string(xml)
    mjhill.check_model(model)
    joint = mjhill.JOINTS["elbow"]
    assert mjhill.read_muscle(model, "flexor") == joint.muscles["elbow_flexor"]
    assert mjhill.read_passive(model, "elbow") == joint.passive


def test_the_parameter_table_is_the_slot_table():
    rows = re.findall(
        r"^\| `(\w+)\[(\d+)\]`(?:, `\[(\d+)\]`)? \| (.*?) \|", PAGES["muscle"], re.MULTILINE
    )
    found = {}
    for array, first, second, names in rows:
        slots = [int(first)] + ([int(second)] if second else [])
        for slot, name in zip(slots, re.findall(r"`(\w+)`", names), strict=False):
            found[name] = (array, slot)
    assert found == mjhill.muscle_model("hill").slots


def table_under(marker):
    page = PAGES["parameters"]
    (table,) = re.findall(rf"<!-- {marker}.*?-->\n(.*?)<!-- end -->", page, re.DOTALL)
    return [line.strip("|").split("|") for line in table.splitlines()]


def test_the_table_of_joints_is_what_is_measured():
    head, _, *rows = table_under("joints")
    held_out = facts()
    for row, joint in zip(rows, mjhill.JOINTS.values(), strict=True):
        for title, cell, value in zip(head, row, brief(joint, held_out).values(), strict=True):
            if isinstance(value, float):  # written with two digits
                assert float(cell) == pytest.approx(value, rel=0.06), (joint.name, title)
            else:
                assert cell.strip() == (value or ""), (joint.name, title)


def test_the_page_of_joints_has_the_numbers_of_the_parameter_file():
    page = (ROOT / "docs" / "joints.md").read_text(encoding="utf-8")
    _, page, values = re.split(r"^## (?:Passive torques .*|Parameters)$", page, flags=re.M)
    for joint in mjhill.JOINTS.values():
        for free in free_parameters(joint.name):
            (cell,) = re.findall(rf"^\| {joint.name} \| {free.name} \| (\S+) \|", values, re.M)
            assert float(cell) == pytest.approx(value_of(joint, free), rel=6e-3)
        for row in published_rows(joint):
            pattern = rf"^\| {joint.name} \| {re.escape(row['quantity'])} \| \S+ \| \S+ \| (\S+) \|"
            (cell,) = re.findall(pattern, page, re.M)
            assert float(cell) == pytest.approx(row["ours"], rel=6e-3)


def table_of(page, name):
    (table,) = re.findall(rf"<!-- {name}.*?-->\n(.*?)<!-- end -->", page, re.DOTALL)
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]
    ]


def test_the_accuracy_table_is_what_the_benchmark_measures():
    written, measured = table_of(PAGES["numerics"], "accuracy"), accuracy.brief()
    assert [row[0] for row in written] == [row[0] for row in measured]
    for row, (_, cells) in zip(written, measured, strict=True):
        for cell, errors in zip(row[1:], cells, strict=True):
            found = [float(number) for number in cell.split("/")] if cell else None
            # written with two digits; RK4's smallest depend on the last bits of the reference
            assert (found is None and errors is None) or found == pytest.approx(
                errors, rel=0.1, abs=2e-5
            )


def test_the_page_on_numerics_has_what_the_benchmark_measures():
    page = (ROOT / "docs" / "numerics.md").read_text(encoding="utf-8")
    for name, integrator, *cells in table_of(page, "movements"):
        for cell, timestep in zip(cells, accuracy.TIMESTEPS, strict=True):
            found = accuracy.error(name, "mjhill", integrator.upper(), timestep)
            assert float(cell) == pytest.approx(found, rel=0.1, abs=2e-5)
