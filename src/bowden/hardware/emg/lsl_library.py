"""The Lab Streaming Layer's library, loaded when it is first wanted, and quiet."""

import functools
import os
from pathlib import Path
from typing import Any

from bowden.core.errors import StreamError

_PLACES = ("lsl_api.cfg", "~/lsl_api/lsl_api.cfg", "/etc/lsl_api/lsl_api.cfg")
"""Where liblsl looks for its configuration, after the file that the variable LSLAPICFG names."""
_QUIET = "\n[log]\nlevel = -3\n"
"""What liblsl prints to standard error by itself is said in our own words."""


@functools.cache
def library() -> Any:
    """The module pylsl, with the user's lsl_api.cfg in force.

    Raises:
        StreamError: it is not installed, or its liblsl does not load.
    """
    try:
        import pylsl
    except ImportError as error:
        raise StreamError("the Lab Streaming Layer is not installed", do='pip install "bowden[lsl]"') from error
    except (RuntimeError, OSError) as error:
        raise StreamError(
            f"liblsl does not load: {error}", do="install the extra lsl again: pip install --force-reinstall pylsl"
        ) from error
    text = _configuration()
    if "[log]" not in text.lower() and hasattr(pylsl.util.lib, "lsl_set_config_content"):
        pylsl.util.set_config_content(text + _QUIET)
    return pylsl


def _configuration() -> str:
    """The user's lsl_api.cfg, empty where there is none."""
    for place in (os.environ.get("LSLAPICFG", ""), *_PLACES):
        path = Path(place).expanduser()
        if place and path.is_file():
            try:
                return path.read_text(encoding="utf-8", errors="replace")
            except OSError:
                continue
    return ""
