"""What scenes, datasets and fields are pickled and copied as."""

import copyreg
import tempfile
from pathlib import Path
from typing import Any

from ._haptize import Dataset, Field, Scene


def _of_scene(scene: Scene) -> Any:
    return Scene, (scene.text, scene.path)


def _of_dataset(dataset: Dataset) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dataset.haptize"
        dataset.save(file)
        return _dataset, (file.read_bytes(),)


def _dataset(contents: bytes) -> Dataset:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dataset.haptize"
        file.write_bytes(contents)
        return Dataset.load(file)


def _of_field(field: Field) -> Any:
    return Field, (field.dataset, field.interpolation, field.bounds_error, field.fill_value)


copyreg.pickle(Scene, _of_scene)
copyreg.pickle(Dataset, _of_dataset)
copyreg.pickle(Field, _of_field)
