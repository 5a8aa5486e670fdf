"""The examples of docs/python.md."""

import doctest
import shutil
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]


def test_the_examples_of_the_page_are_right(tmp_path, monkeypatch):
    shutil.copy(REPOSITORY / "datasets/sphere.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    flags = doctest.IGNORE_EXCEPTION_DETAIL
    result = doctest.testfile(str(REPOSITORY / "docs/python.md"), module_relative=False, optionflags=flags)
    assert result.attempted > 20 and result.failed == 0
