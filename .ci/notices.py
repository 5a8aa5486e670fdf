"""Prints the licence texts of all crates that a package is compiled from, and of the fonts in this one.

    python3 .ci/notices.py PACKAGE [FEATURES] > LICENSE-THIRD-PARTY
"""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("licen", "copying", "notice", "unlicense")


def cargo(*arguments: str) -> str:
    return subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    package, features = sys.argv[1], ["--features", sys.argv[2]] if len(sys.argv) > 2 else []
    tree = cargo("tree", "--locked", "-p", package, *features, "-e", "normal", "--target", "all", "--prefix", "none", "-f", "{p}")
    used = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    packages = json.loads(cargo("metadata", "--locked", "--format-version", "1"))["packages"]
    # Those of this repository have no source: their licence is the package's own.
    foreign = [p for p in packages if p["source"] and (p["name"], "v" + p["version"]) in used]
    texts: dict[str, list[str]] = {}
    for found in sorted(foreign, key=lambda p: p["name"]):
        folder = Path(found["manifest_path"]).parent
        files = sorted(file for file in folder.iterdir() if file.is_file() and file.name.lower().startswith(NAMES))
        name = f"{found['name']} {found['version']}, {found['license'] or 'licence in its file'}"
        for text in [file.read_text(errors="replace").strip() for file in files] or ["(There is no licence text in the crate.)"]:
            texts.setdefault(text, []).append(name)
    for font in sorted((ROOT / "src/draw/fonts").glob("*LICEN*")):
        texts.setdefault(font.read_text().strip(), []).append("the fonts of Roboto")
    for text, names in texts.items():
        print("\n".join(names), text, "-" * 80, sep="\n\n", end="\n\n")


if __name__ == "__main__":
    main()
