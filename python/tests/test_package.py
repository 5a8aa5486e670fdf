"""What the wheel brings beside the module: the command, types, documentation."""

import copy
import errno
import importlib.metadata
import json
import multiprocessing
import pickle
import re
import subprocess
import sys
from pathlib import Path

import haptize
import numpy as np
import pytest
from conftest import PRESSED, SCENE

# A finger of one joint with a ball at its end.
URDF = """<robot name="finger">
  <link name="base"/>
  <link name="tip">
    <inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
    <collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tip"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>"""


def test_the_command_is_installed(tmp_path):
    (tmp_path / "small.toml").write_text(SCENE)
    program = Path(sys.executable).with_name("haptize")
    baked = subprocess.run([program, "bake", "small.toml", "--backend", "cpu", "--json"], cwd=tmp_path, capture_output=True)
    assert baked.returncode == 0, baked.stderr
    assert json.loads(baked.stdout)["points"] == 63
    assert haptize.Dataset.open(tmp_path / "small.haptize").shape == (7, 9)
    module = subprocess.run([sys.executable, "-m", "haptize", "info", "none"], cwd=tmp_path, capture_output=True)
    assert module.returncode == 1 and b"none" in module.stderr
    wrong = subprocess.run([program, "boil"], capture_output=True)
    assert wrong.returncode == 2
    version = subprocess.run([program, "--version"], capture_output=True, text=True)
    assert version.stdout.split() == ["haptize", haptize.__version__]


def test_scenes_datasets_and_fields_are_pickled_and_copied(scene, dataset):
    field = haptize.Field(dataset, "linear", False, -1.0)
    for copied in (lambda thing: pickle.loads(pickle.dumps(thing)), copy.copy, copy.deepcopy):
        other = copied(scene)
        assert (other.text, other.path, other.joints) == (scene.text, scene.path, scene.joints)
        other = copied(dataset)
        assert np.array_equal(other.torque, dataset.torque) and other.scene == dataset.scene
        assert all(np.array_equal(*columns) for columns in zip(other.contacts, dataset.contacts))
        other = copied(field)
        q = [[*PRESSED], [5.0, 5.0]]
        assert np.array_equal(other.torque(q), field.torque(q)) and other.torque(q)[1, 0] == -1.0


@pytest.mark.parametrize("method", [method for method in ("spawn", "fork") if method in multiprocessing.get_all_start_methods()])
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_scenes_datasets_and_fields_go_to_other_processes(scene, dataset, field, method):
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.apply(getattr, (scene, "joints")) == scene.joints
        assert np.array_equal(pool.apply(getattr, (dataset, "torque")), dataset.torque)
        assert np.array_equal(pool.apply(haptize.Field.torque, (field, PRESSED)), field.torque(PRESSED))


def test_files_that_are_not_there_are_told_as_python_tells_them(tmp_path):
    missing = tmp_path / "none.haptize"
    for read in (haptize.Dataset.open, haptize.Dataset.load, haptize.Field.open, haptize.Scene.load):
        with pytest.raises(FileNotFoundError, match="No such file") as raised:
            read(missing)
        assert raised.value.errno == errno.ENOENT and Path(raised.value.filename) == missing
    # There, but not what it should be.
    missing.write_text("nothing")
    with pytest.raises(haptize.DatasetError):
        haptize.Dataset.open(missing)


def test_commands_are_run_and_report(file, tmp_path):
    report = haptize.run("info", file)
    assert report["axes"][0]["name"] == "turn"
    with pytest.raises(haptize.Error, match="none"):
        haptize.run("info", tmp_path / "none")
    robot = tmp_path / "finger.urdf"
    robot.write_text(URDF)
    imported = haptize.run("import", robot, tip="tip", spacing=0.02, output=tmp_path / "finger.toml")
    assert "turn" in imported["joints"] and haptize.Scene.load(imported["file"]).joints == ["turn"]


def test_the_recipe_for_conda_says_what_the_package_says():
    package = Path(__file__).parents[1]
    recipe = (package / "../packaging/conda/recipe.yaml").read_text()
    metadata = importlib.metadata.metadata("haptize")
    required = [name for name in metadata.get_all("Requires-Dist") if "extra" not in name]
    required += re.findall(r'requires = \["(.*)"\]', (package / "pyproject.toml").read_text())
    assert len(required) == 2
    for name in required:
        assert f"- {re.sub('(?=[<>=])', ' ', name, count=1)}\n" in recipe, name
    for field in (
        f'version: "{haptize.__version__}"',
        f"license: {metadata['License-Expression']}",
        f"summary: {metadata['Summary']}",
    ):
        assert f"  {field}\n" in recipe, field


def test_the_wheel_says_what_it_is_and_has_its_licences():
    distribution = importlib.metadata.distribution("haptize")
    metadata = distribution.metadata
    assert metadata["License-Expression"] == "MIT OR Apache-2.0" and metadata["Author"] and metadata["Keywords"]
    assert "solved beforehand" in (metadata["Description"] or metadata.get_payload())
    texts = {file.name: file.read_text() for file in distribution.files if "licenses" in file.parts}
    assert {"LICENSE-MIT", "LICENSE-APACHE", "LICENSE-THIRD-PARTY"} <= set(texts)
    assert "the fonts of Roboto" in texts["LICENSE-THIRD-PARTY"] and "wgpu" in texts["LICENSE-THIRD-PARTY"]


def test_every_name_is_documented():
    page = (Path(__file__).resolve().parents[2] / "docs/python.md").read_text()
    for name in haptize.__all__:
        thing = getattr(haptize, name)
        assert name == "__version__" or (thing.__doc__ and thing.__doc__.strip()), name
        for method in (vars(thing) if isinstance(thing, type) else ()):
            assert method.startswith("_") or getattr(thing, method).__doc__, f"{name}.{method}"
            assert method.startswith("_") or re.search(rf"[`.]{method}\b", page), f"docs/python.md does not name {name}.{method}"
        assert name == "__version__" or f"`{name}" in page, f"docs/python.md does not name {name}"
