"""Writing files whole or not at all, one or several that belong together."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bowden.core.errors import OutputError

_DO = "choose another place or make room there"


def state_folder() -> Path:
    """Where this user's programs keep what outlives them; bowden's part of it. It need not be there.

    Raises:
        RuntimeError: a user without a home.
    """
    root = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    return root / "bowden"


@contextlib.contextmanager
def whole_files(folder: Path | str) -> Iterator[Path]:
    """A folder to write to; what is in it takes its place in `folder`, all together, when all went well.

    After an error or an interruption `folder` is as it was: files that were there are back, and the folders that had to
    be made for it are gone.

    Raises:
        OutputError: `folder` cannot be made or written, the disk is full, or a folder stands where a file should go.
    """
    target = Path(folder)
    with _folders(target), _staged(target, str(target)) as stage:
        yield stage


@contextlib.contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """A path to write to; the file takes the place of `path` only when all went well.

    Raises:
        OutputError: the folder does not exist, is not writable, or the disk is full.
    """
    target = Path(path)
    with _staged(target.parent, str(target)) as stage:
        yield stage / target.name


def write_text(path: Path | str, text: str) -> None:
    """Write a text file whole or not at all, in UTF-8.

    Raises:
        OutputError: see `whole_file`.
    """
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def _folders(target: Path) -> Iterator[None]:
    """`target` and its parents, made where they are missing and removed again when something goes wrong."""
    made: list[Path] = []
    try:
        try:
            for folder in (*reversed(target.parents), target):
                if not folder.is_dir():
                    folder.mkdir(exist_ok=True)
                    made.append(folder)
        except (OSError, ValueError) as error:  # ValueError: a null byte in its name
            raise OutputError(f"cannot make the folder {target}: {_reason(error)}", do="choose another one") from None
        yield
    except BaseException:
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


@contextlib.contextmanager
def _staged(folder: Path, what: str) -> Iterator[Path]:
    """A temporary folder inside `folder`, and so on the same disk, whose files are moved into it at the end."""
    stage = None
    try:
        stage = Path(tempfile.mkdtemp(prefix=".bowden-", dir=folder))
        yield stage
        _move(stage, folder)
    except OSError as error:
        raise OutputError(f"cannot write {what}: {_reason(error)}", do=_DO) from None
    except OutputError as error:  # of one file in the stage: say where it was to go
        raise OutputError(error.what.replace(str(stage), str(folder)), expected=error.expected, do=error.do) from None
    finally:
        if stage is not None:
            shutil.rmtree(stage, ignore_errors=True)


def _move(stage: Path, folder: Path) -> None:
    """Move every file from `stage` to `folder`, or none."""
    names = sorted(path.name for path in stage.iterdir())
    for name in names:
        if (folder / name).is_dir():
            raise OutputError(f"cannot write {folder / name}: it is a folder", do="remove it or choose another place")
    replaced = stage / ".replaced"
    replaced.mkdir()
    try:
        for name in names:
            if os.path.lexists(folder / name):
                (folder / name).replace(replaced / name)
            (stage / name).replace(folder / name)
    except BaseException:
        for name in names:
            if os.path.lexists(replaced / name):
                (replaced / name).replace(folder / name)
            elif not os.path.lexists(stage / name):
                (folder / name).unlink(missing_ok=True)
        raise


def _reason(error: Exception) -> str:
    """The system's message, without the path."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


def output_folder(path: Path, option: str = "--out") -> Path:
    """`path`, known to be a folder that can be made and written; nothing is made yet.

    Raises:
        OutputError: something that is no folder stands in the way, it may not be written, or its name is too long.
    """
    do = f"choose another one with {option}"
    try:
        nearest = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
        for part in path.parts:  # the system looks at a name's length only in a folder that is there
            (nearest / part).exists()
        is_folder, is_writable = nearest.is_dir(), os.access(nearest, os.W_OK)
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise OutputError(f"cannot write to {shortened(str(path))}: {reason}", do=do) from None
    if not is_folder:
        raise OutputError(f"cannot write to {path}: {nearest} is not a folder", do=do)
    if not is_writable:
        raise OutputError(f"cannot write to {path}: {nearest} is read-only", do=do)
    return path


def shortened(text: str, most: int = 80) -> str:
    """A text for a message, cut where it is long."""
    return text if len(text) <= most else text[: most - 1] + "…"


def printable(text: str) -> str:
    """A text of others for a terminal, which takes no order from it.

    >>> printable("\\x1b[2Jlab")
    '·[2Jlab'
    """
    return "".join(letter if letter.isprintable() else "·" for letter in text)
