"""Scenes, datasets and fields show themselves in notebooks."""

import base64
import html
import json
import re
import zlib

import haptize
import numpy as np
import pytest


def numbers(shown):
    """What a page within a frame holds, and a function that returns an array of it."""
    frame = re.fullmatch(r'<iframe title="([^"<>]*)" srcdoc="([^"<>]*)" style="[^"]*"></iframe>', shown)
    page = html.unescape(frame[2])
    assert page.startswith("<!doctype html>") and page.endswith("</html>\n")
    scene = json.loads(re.search(r'<script type="application/json" id="scene">(.*?)</script>', page, re.S)[1])
    data = re.search(r'id="data">(.*?)</script>', page, re.S)[1]
    block = zlib.decompress(base64.b64decode(data))
    types = {"f32": np.float32, "u32": np.uint32, "i16": np.int16, "u8": np.uint8}
    return scene, lambda span: np.frombuffer(block, types[span["type"]], span["length"], span["at"])


def test_a_dataset_shows_its_torque_and_its_object(dataset):
    scene, array = numbers(dataset._repr_html_())
    plane = scene["plane"]
    # Two joints: the plane is the whole grid, the first joint across.
    assert plane["axes"] == [0, 1] and plane["count"] == list(dataset.shape)
    torque = array(plane["torque"]).reshape(2, dataset.shape[1], dataset.shape[0])
    wanted = np.where(dataset.status == 0, 0, np.moveaxis(dataset.torque, -1, 0)).astype(np.float32)
    assert np.array_equal(torque, np.moveaxis(wanted, 1, 2)) and np.abs(torque).max() > 0
    assert np.array_equal(array(scene["body"]["rest"]).reshape(-1, 3), dataset.surface[0].astype(np.float32))
    # The arm stands where the torque of the joint that turns is largest; a force is not compared with it.
    at = tuple(np.abs(line - q).argmin() for line, q in zip(dataset.lines, plane["at"]))
    assert [line[k] for line, k in zip(dataset.lines, at)] == pytest.approx(plane["at"], abs=1e-12)
    turns = np.abs(dataset.torque[..., 0])
    assert dataset.axes[0]["unit"] == "rad" and turns[at] == turns.max()


def test_a_field_shows_its_dataset_and_a_scene_its_object(scene, dataset):
    assert haptize.Field(dataset)._repr_html_() == dataset._repr_html_()
    shown, array = numbers(scene._repr_html_())
    assert [joint["name"] for joint in shown["joints"]] == scene.joints and shown["plane"] is None
    assert len(array(shown["body"]["rest"])) == dataset.surface[0].size
