import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent

SMOKE = """
import mujoco, mjhill
model = mjhill.load("elbow")
data = mujoco.MjData(model)
with mjhill.installed():
    data.ctrl[0] = 0.5
    mujoco.mj_step(model, data, nstep=500)
print(mjhill.__file__, mjhill.model_path("elbow"), data.qpos[0] > 1, sep="\\n")
"""


def run(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_alone_runs_the_elbow(tmp_path):
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
    run(*pip, "wheel", str(ROOT), "--no-deps", "--no-build-isolation", "-w", str(tmp_path))
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    run(*pip, "install", str(wheel), "--no-deps", "--target", str(site))
    where, model, moved = run(
        sys.executable, "-c", SMOKE, env={"PYTHONPATH": str(site)}, cwd=tmp_path
    ).splitlines()
    assert Path(where).is_relative_to(site)
    assert Path(model).is_relative_to(site)
    assert moved == "True"
    assert (site / "mjhill" / "py.typed").exists()
    assert (site / "mjhill" / "models" / "elbow" / "elbow.xml").exists()
    assert (site / "mjhill" / "report" / "template.html").exists()
    assert (site / "mjhill" / "report" / "style.css").exists()


def test_every_example_runs_and_prints_a_number_with_its_unit():
    for example in sorted((ROOT / "examples").glob("*.py")):
        output = run(sys.executable, str(example))
        assert any(unit in output for unit in ("°", " N", " mm", " ms", " rad")), example
