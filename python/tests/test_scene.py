"""Scenes from texts, dicts and files; where they are wrong."""

import haptize
import numpy as np
import pytest
from conftest import SCENE


def tables():
    return {
        "object": {
            "sphere": {"radius": 0.05, "rings": 4, "segments": 5},
            "springs": {"kind": "isotropic", "stiffness": 300.0},
            "ground": {"stiffness": np.float64(100.0)},
        },
        "contact": {"stiffness": 1000.0},
        "grid": {"axes": [{"start": -0.3, "step": 0.1, "count": np.int64(7)}]},
        "proxy": {
            "joint": [
                {"name": "turn", "kind": "revolute", "axis": np.array([0, 0, 1]), "limits": [-1, 1],
                 "nodes": [{"at": [0.04, 0.0, 0.0]}]},
            ]
        },
    }


def test_a_scene_knows_its_name_and_joints(scene):
    assert scene.name == "small sphere"
    assert scene.joints == ["turn", "slide"]
    assert scene.text == SCENE


def test_a_dict_is_the_same_scene_as_its_text():
    scene = haptize.Scene(tables())
    assert scene.joints == ["turn"]
    again = haptize.Scene(scene.text)
    assert np.array_equal(haptize.solve(scene, [0.1]).torque, haptize.solve(again, [0.1]).torque)


def test_an_error_names_file_and_line(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(SCENE.replace("radius = 0.05", "radius = -0.05"))
    with pytest.raises(haptize.SceneError) as raised:
        haptize.Scene.load(path)
    assert str(raised.value.path) == str(path)
    assert raised.value.line == 5 and raised.value.column > 1
    assert "wrong.toml:5:" in str(raised.value)
    assert isinstance(raised.value, haptize.Error)


@pytest.mark.parametrize("wrong", [None, 3, b"text", ["text"]])
def test_what_is_no_scene_is_refused(wrong):
    with pytest.raises(TypeError):
        haptize.Scene(wrong)


@pytest.mark.parametrize("wrong", [None, float("nan"), float("inf"), "fifty", object()])
def test_a_dict_with_what_no_scene_holds_is_refused(wrong):
    scene = tables()
    scene["object"]["sphere"]["radius"] = wrong
    with pytest.raises((TypeError, haptize.SceneError)):
        haptize.Scene(scene)
