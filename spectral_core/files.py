"""Reading texts that may be anything, and writing so that a killed run leaves the old file or the new one."""

from __future__ import annotations

import os
import re
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from spectral_core.errors import OutputError, SpectralBoothError

# A table of spectra, a scene or a profile is far smaller; what is larger is some other file.
_LARGEST_TEXT_MB = 64
_PART = ".part"


def is_file(path: Path) -> bool:
    """Whether there is such a file; a name that no file system can hold is none."""
    try:
        return path.is_file()
    except OSError:  # too long a name
        return False


def why_no_file(path: Path) -> str:
    """What is wrong with a path that should have named a file."""
    try:
        return "is a folder" if path.is_dir() else "no such file"
    except OSError as error:
        return f"no such file ({error.strerror})"


def read_bytes(path: Path, error: type[SpectralBoothError], remedy: str, limit: int) -> bytes:
    """A whole file of at most `limit` bytes, a multiple of 1 MB.

    Raises
    ------
    error
        With one clear line and the remedy, if it is missing, a folder, unreadable or too large.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(limit + 1)
    except (OSError, ValueError) as problem:  # ValueError: a null character in the name
        what = f"cannot be read ({problem})" if is_file(path) else why_no_file(path)
        raise error(what, where=path, remedy=remedy) from None
    if len(data) > limit:
        raise error(f"larger than {limit // (1024 * 1024)} MB", where=path, remedy=remedy)
    return data


def read_text(path: Path, error: type[SpectralBoothError], remedy: str) -> str:
    """A text file as UTF-8, byte-order mark dropped.

    Raises
    ------
    error
        With one clear line and the remedy, if it is missing, a folder, unreadable, too large or no text.
    """
    data = read_bytes(path, error, remedy, _LARGEST_TEXT_MB * 1024 * 1024)
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise error("is not a text file in UTF-8", where=path, remedy=remedy) from None


@contextmanager
def atomic_path(path: str | Path, keep_suffix: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` when the block ends without error.

    The temporary name ends as `path` does, for writers that go by it, unless `keep_suffix` is False: then
    whoever looks for files of that kind meanwhile does not find one that is half written.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to, or `path` is a folder or a device.
    """
    target = Path(path)
    try:
        # A link stays a link: what it points to is replaced.
        target = target.resolve() if target.is_symlink() else target
        if target.exists() and not target.is_file():  # renaming would make a file of a device
            raise OutputError(
                "is a folder" if target.is_dir() else "is no ordinary file", where=path, remedy="name a file"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(target)
        suffix = target.suffix if keep_suffix else _PART
        handle, name = tempfile.mkstemp(prefix=_prefix(target, os.getpid()), suffix=suffix, dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(
            f"cannot be written ({error.strerror})", where=target, remedy="choose another folder"
        ) from None
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(target)
    except IsADirectoryError:
        raise OutputError("is a folder", where=target, remedy="name a file") from None
    except OSError as error:
        raise OutputError(f"cannot be written ({error.strerror})", where=target, remedy="is the disk full?") from None
    finally:
        temporary.unlink(missing_ok=True)


def _prefix(target: Path, process: int) -> str:
    """Temporary names tell whose they are: a machine and a process."""
    return f".{target.stem}.{uuid.getnode():x}-{process}."


def _remove_leftovers(target: Path) -> None:
    """Remove what killed processes of this machine left of `target`."""
    if os.name != "posix":  # elsewhere asking after a process may end it
        return
    # Compared by hand: a name may hold what a pattern would take for a rule.
    pattern = re.compile(
        rf"{re.escape(_prefix(target, 0)[:-2])}(\d+)\..*({re.escape(target.suffix)}|{_PART})", re.DOTALL
    )
    with suppress(OSError):  # a folder that may be written to but not listed
        for each in target.parent.iterdir():
            match = pattern.fullmatch(each.name)
            if match and not _runs(int(match[1])):
                each.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is somebody else's, or no process at all
        return True
    return True


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
