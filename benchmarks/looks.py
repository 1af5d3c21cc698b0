"""Looks at the sets of cases that judge: each is written down, and counted, before anything is run."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from bowden.core.kernel_cache import source_hash


def counted(file: Path, set_name: str, told: Mapping[str, str | list[str]]) -> int:
    """Write down that a set is looked at; how often it has been, this time included, and 0 of the development set.

    Args:
        file: TOML, a table for each look.
        set_name: of the set.
        told: what is run on what of it, by key.
    """
    if set_name == "development":
        return 0
    before = file.read_text(encoding="utf-8") if file.is_file() else ""
    count = before.count(f'set = "{set_name}"') + 1
    entry = [
        "[[look]]",
        f'set = "{set_name}"',
        f"count = {count}",
        *(f"{key} = {json.dumps(value)}" for key, value in told.items()),
        f'source = "{source_hash()}"',
        f'time = "{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"',
    ]
    file.write_text(before + ("\n" if before else "") + "\n".join(entry) + "\n", encoding="utf-8")
    return count
