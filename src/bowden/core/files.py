"""Writing files whole or not at all."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from bowden.core.errors import OutputError


@contextlib.contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """A path beside `path` to write to; it takes the place of `path` only when all went well.

    Raises:
        OutputError: the folder does not exist, is not writable, or the disk is full.
    """
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise OutputError(
            f"cannot write {target}: {error.strerror or error}", do="choose another place or make room there"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
