"""Where a run took place and with which software, for the head of its log."""

import platform
import subprocess
from pathlib import Path

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
    """The commit of a folder, with ``+`` where files differ from it; empty where there is no git or no commit."""
    command = [
        "git",
        "--no-optional-locks",
        *("-c", "core.fsmonitor=false"),  # a folder's own settings name a program there, which git would run
        "-C",
        str(folder),
        "describe",
        "--always",
        "--abbrev=40",
        "--exclude=*",
        "--dirty=+",
    ]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
