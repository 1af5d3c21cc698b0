"""Where a run took place and with which software, for the head of its log."""

import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import bowden


def provenance(rig: str = "") -> dict[str, str]:
    """Software version, git revisions (of the package and of the rig, where there are such), host, kernel."""
    revisions = {"software_revision": _revision(Path(bowden.__file__).parent), "rig_revision": rig}
    found = {
        "software": f"bowden {bowden.__version__}",
        "python": platform.python_version(),
        "host": platform.node(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }
    return found | {name: revision for name, revision in revisions.items() if revision}


def rig_revision(folder: Path) -> str:
    """The commit of a rig's folder; empty where it is in no repository."""
    return _revision(folder)


def _revision(folder: Path) -> str:
    """The commit of a folder, with ``+`` where files differ from it, or may; empty where there is no git or no commit.

    A repository's own settings name programs that git runs when it looks whether a file differs: filters, a monitor of
    files, helpers to fetch what is missing. So its settings are read for the names of its parts alone; the files are
    compared by a repository of ours without any, which borrows its objects and its index.
    """
    found = _git(["-C", str(folder), "rev-parse", "--show-toplevel", "--git-common-dir", "--absolute-git-dir", "HEAD"])
    lines = found.stdout.removesuffix("\n").split("\n") if found is not None and found.returncode == 0 else []
    if len(lines) != 4:  # no commit, or a name with a line break in it
        return ""
    try:
        same = _same(folder, *lines)
    except OSError:  # no room for temporary files
        same = False
    return lines[-1] if same else f"{lines[-1]}+"


def _same(folder: Path, top: str, common: str, own: str, commit: str) -> bool:
    """True if the files of a repository are surely those of its commit.

    Raises:
        OSError: no temporary folder can be made or written.
    """
    with tempfile.TemporaryDirectory(prefix="bowden-git-") as made:
        ours, form = Path(made), "sha1" if len(commit) == 40 else "sha256"
        (ours / "refs").mkdir()
        (ours / "objects").mkdir()
        (ours / "HEAD").write_text(f"{commit}\n", encoding="ascii")
        version = f"[core]\nrepositoryformatversion = 1\n[extensions]\nobjectformat = {form}\n"
        (ours / "config").write_text(version, encoding="ascii")
        borrowed = {
            "GIT_DIR": made,
            "GIT_WORK_TREE": top,
            "GIT_INDEX_FILE": str(Path(own) / "index"),
            "GIT_ALTERNATE_OBJECT_DIRECTORIES": str(folder / common / "objects"),
        }
        same = _git(["diff", "--quiet", "--no-ext-diff", "--no-textconv", "--ignore-submodules=all", "HEAD"], borrowed)
    return same is not None and same.returncode == 0


def _git(words: list[str], more: Mapping[str, str] = MappingProxyType({})) -> "subprocess.CompletedProcess[str] | None":
    """git's answer; None where there is none, or it takes too long."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    safe = {"GIT_OPTIONAL_LOCKS": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": "", "GIT_TERMINAL_PROMPT": "0"}
    try:
        return subprocess.run(
            ["git", *words],
            capture_output=True,
            encoding=sys.getfilesystemencoding(),
            errors="surrogateescape",  # as Python reads the names of files
            timeout=5.0,
            env=environment | safe | dict(more),
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
