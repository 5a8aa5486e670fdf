"""What the wheel brings beside the module: the command, types, documentation."""

import json
import re
import subprocess
import sys
from pathlib import Path

import haptize
from conftest import SCENE


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


def test_every_name_is_documented():
    page = (Path(__file__).resolve().parents[2] / "docs/python.md").read_text()
    for name in haptize.__all__:
        thing = getattr(haptize, name)
        assert name == "__version__" or (thing.__doc__ and thing.__doc__.strip()), name
        for method in (vars(thing) if isinstance(thing, type) else ()):
            assert method.startswith("_") or getattr(thing, method).__doc__, f"{name}.{method}"
            assert method.startswith("_") or re.search(rf"[`.]{method}\b", page), f"docs/python.md does not name {name}.{method}"
        assert name == "__version__" or f"`{name}" in page, f"docs/python.md does not name {name}"
