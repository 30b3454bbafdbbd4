"""The two files of ENVI: a header and its data, each found from the other."""

from __future__ import annotations

from pathlib import Path

from spectral_core.errors import TextureError
from spectral_core.files import is_file
from spectral_core.textures.envi.text import begins_header

# What ENVI, its users' software and makers of cameras call the data file of NAME.hdr.
_DATA_SUFFIXES = (
    ".img", ".raw", ".dat", ".bil", ".bip", ".bsq", ".fla", ".bin", ".cube", ".hsi", ".hyspex", ".rad", ".ref",
    ".refl", ".rfl", ".envi", ".sli", ".slb",
)  # fmt: skip


def header_and_data(path: Path) -> tuple[Path, Path]:
    """Paths of the header and of the data file, of which `path` is either.

    Raises
    ------
    TextureError
        If the other one is missing, or it is not clear which file it is.
    """
    if is_header(path):
        return path, _data_beside(path)
    header = header_beside(path)
    if header is None:
        raise TextureError("has no ENVI header beside it", where=path, remedy=f"give {path.name}.hdr")
    return header, path


def is_header(path: Path) -> bool:
    """Whether a file begins like an ENVI header; what cannot be read does not."""
    try:
        with path.open("rb") as stream:
            return begins_header(stream.read(16))
    except (OSError, ValueError):
        return False


def header_beside(path: Path) -> Path | None:
    """The ENVI header of a data file: ``x.raw.hdr`` or ``x.hdr`` beside ``x.raw``; None if there is none.

    The second one only for suffixes of ENVI's data files: ``x.csv`` beside it is another thing.
    """
    if not path.name:
        return None
    exact = path.with_name(f"{path.name}.hdr")
    if is_header(exact):
        return exact
    if path.suffix.casefold() not in ("", *_DATA_SUFFIXES):
        return None
    for name in (f"{path.name}.hdr", f"{path.stem}.hdr"):
        for found in _called(path.parent, {name.casefold()}):
            if found != path and is_header(found):
                return found
    return None


def _data_beside(header: Path) -> Path:
    """``x`` or else ``x.raw`` beside ``x.hdr``, ``x.raw`` beside ``x.raw.hdr``."""
    stem = header.stem if header.suffix.casefold() == ".hdr" else header.name
    exact = header.with_name(stem)
    if exact != header and is_file(exact):
        return exact
    wanted = {f"{stem}{suffix}".casefold() for suffix in ("", *_DATA_SUFFIXES)}
    found = [each for each in _called(header.parent, wanted) if each != header]
    if len(found) == 1:
        return found[0]
    if not found:
        raise TextureError(
            "is an ENVI header without its data file", where=header, remedy=f"put {stem}.raw or the like beside it"
        )
    names = ", ".join(each.name for each in found[:4])
    raise TextureError(
        f"could be the header of {names}", where=header, remedy="open the data file you mean by its name"
    )


def _called(folder: Path, names: set[str]) -> list[Path]:
    """Files of a folder by their names in lower case, in order."""
    try:
        return sorted(each for each in folder.iterdir() if each.name.casefold() in names and is_file(each))
    except (OSError, ValueError):  # ValueError: a null character in the name
        return []
