"""Where a run took place and with which software, for the head of its log."""

import platform
import subprocess
from pathlib import Path

import bowden


def provenance(rig: Path | None = None) -> dict[str, str]:
    """Software version, git revisions (of the package and of the rig's folder, where they are in one), host, kernel."""
    places = {"software_revision": Path(bowden.__file__).parent, "rig_revision": rig}
    found = {
        "software": f"bowden {bowden.__version__}",
        "python": platform.python_version(),
        "host": platform.node(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }
    revisions = {name: _revision(folder) for name, folder in places.items() if folder is not None}
    return found | {name: revision for name, revision in revisions.items() if revision}


def _revision(folder: Path) -> str:
    """The commit of a folder, with ``+`` where files differ from it; empty where there is no git or no commit."""
    command = [
        "git",
        "--no-optional-locks",
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
