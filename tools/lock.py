"""The lock: which version of every package bowden was tested with, with the hashes of its files; `make lock`.

``requirements/core.txt`` has what `pip install bowden` brings, ``requirements/dev.txt`` what the tests need too, each
for all versions of Python and all systems. Both are made by uv (``pip install uv``) from pyproject.toml. Where packages
are downloaded from is the installer's to say, not theirs.

    python tools/lock.py            # make both anew
    python tools/lock.py --check    # do they belong to this pyproject.toml? (no network)
"""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[1]
LOCKS: dict[str, tuple[str, ...]] = {"core": (), "dev": ("dev",)}
"""File → extras of pyproject.toml that are in it."""
_ABOUT = "# pyproject.toml "
_PIN = re.compile(r"^([A-Za-z0-9][\w.-]*)==([^\s;\\]+)(?:\s*;\s*([^\\]*))?", re.MULTILINE)


def project() -> dict[str, Any]:
    """What pyproject.toml says of the project."""
    found: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return found


def digest(said: dict[str, Any]) -> str:
    """Of all that a lock depends on."""
    keys = ("requires-python", "dependencies", "optional-dependencies")
    return hashlib.sha256(json.dumps([said[key] for key in keys], sort_keys=True).encode()).hexdigest()[:16]


def wanted(said: dict[str, Any], extras: tuple[str, ...]) -> list[Requirement]:
    """What pyproject.toml asks for with these extras, those that they name included."""
    found = [Requirement(one) for one in said["dependencies"]]
    waiting, seen = list(extras), set()
    while waiting:
        extra = waiting.pop()
        if extra in seen:
            continue
        seen.add(extra)
        for one in map(Requirement, said["optional-dependencies"][extra]):
            if canonicalize_name(one.name) == said["name"]:
                waiting += one.extras
            else:
                found.append(one)
    return found


def problems(said: dict[str, Any], name: str, text: str) -> list[str]:
    """What is wrong with a lock: not made from this pyproject.toml, or lacking what that asks for."""
    found = []
    if _ABOUT + digest(said) not in text:
        found.append(f"{name}.txt was made from another pyproject.toml")
    pins: dict[str, list[Version]] = {}
    for package, version, _ in _PIN.findall(text):
        pins.setdefault(canonicalize_name(package), []).append(Version(version))
    for one in wanted(said, LOCKS[name]):
        there = pins.get(canonicalize_name(one.name), [])
        if not there:
            found.append(f"{name}.txt lacks {one.name}")
        elif not all(version in one.specifier for version in there):
            found.append(f"{name}.txt has {one.name} {', '.join(map(str, there))}, and {one} is asked for")
    blocks = re.split(r"\n(?=\S)", text)
    found += [
        f"{name}.txt: {block.split()[0]} has no hash"
        for block in blocks
        if _PIN.match(block) and "--hash=" not in block
    ]
    if re.search(r"https?://|--(extra-)?index-url|--find-links", text):
        found.append(f"{name}.txt says where packages are downloaded from")
    return found


def make(name: str) -> None:
    """Write a lock."""
    said = project()
    extras = [word for extra in LOCKS[name] for word in ("--extra", extra)]
    options = ["--universal", "--generate-hashes", "--no-emit-index-url", "--no-emit-find-links", "--no-header", "-q"]
    command = ["uv", "pip", "compile", *options, *extras, "--python-version", "3.11", "pyproject.toml"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"uv: {done.stderr.strip()}")
    head = f"# Made by make lock.\n{_ABOUT}{digest(said)}\n"
    (ROOT / "requirements" / f"{name}.txt").write_text(head + done.stdout, encoding="utf-8")


def main() -> None:
    """Make the locks, or check them."""
    if sys.argv[1:] != ["--check"]:
        for name in LOCKS:
            make(name)
    texts = {name: (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8") for name in LOCKS}
    found = [problem for name, text in texts.items() for problem in problems(project(), name, text)]
    sys.exit("\n".join([*found, "make them anew: make lock"]) if found else 0)


if __name__ == "__main__":
    main()
