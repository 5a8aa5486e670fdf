"""The notebook: its code cells run, and what they drew is committed with them."""

import json
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def test_the_cells_of_the_notebook_run(monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    pyplot.close("all")
    monkeypatch.chdir(EXAMPLES)
    cells = [cell for cell in json.loads((EXAMPLES / "bean.ipynb").read_text())["cells"] if cell["cell_type"] == "code"]
    names: dict = {}
    for cell in cells:
        exec("".join(cell["source"]), names)
    assert abs(names["force"][1500, 1]) > 1.0 and len(pyplot.get_fignums()) == 4
    pyplot.close("all")
    drawn = [output for cell in cells for output in cell["outputs"] if "image/png" in output.get("data", {})]
    assert len(drawn) == 4 and all(cell["execution_count"] for cell in cells)
