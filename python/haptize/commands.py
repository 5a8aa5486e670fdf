"""The commands of the program, called from Python."""

from __future__ import annotations

import json
import subprocess
import sys
from os import PathLike, fspath
from typing import Any

from ._haptize import Error


def run(command: str, *files: str | PathLike[str], **options: Any) -> dict[str, Any]:
    """Run a command of the program in a process of its own, and return its report: what it prints with `--json`.

    run("reach", "arm.toml", max_error="2%") is `haptize reach arm.toml --max-error 2%`. An option of True has no value, one of False or None
    is left out, and one with a list is given several times. Notes go to standard error. Error says why a command failed.
    """
    # By the paths of this process: `-m` would look in the current folder first.
    program = f"import sys; sys.path[:] = {sys.path!r}; from haptize.__main__ import main; main()"
    line = [sys.executable, "-c", program, command, *(fspath(file) for file in files), "--json"]
    for name, value in options.items():
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if one is not None and one is not False:
                option = "--" + name.replace("_", "-")
                line.append(option if one is True else f"{option}={one}")
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True)
    try:
        report: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        raise Error(f"`haptize {command}` ended with code {done.returncode} and no report") from None
    # A failure is a sentence; the error of an interpolation is a number.
    if isinstance(report.get("error"), str):
        raise Error(report["error"])
    return report
