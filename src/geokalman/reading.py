"""Opening a user's file and parsing its numbers: what all readers of the package share.

Compression is recognised by the first bytes, never by the name. Text may be UTF-8 (with or without byte order mark),
UTF-16 with one, or Latin-1. Nothing is trusted: not the length of a line, nor what a packed file unpacks to.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import math
import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

MAX_LINE = 1 << 20
"""Characters of the longest line that is read."""
MAX_BYTES = 2 << 30
"""Bytes of the largest file that is read whole, after unpacking."""

_OPENERS = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\x00": lzma.open, b"BZh": bz2.open}
_ARCHIVES = {
    b"PK\x03\x04": "a zip archive",
    b"PK\x05\x06": "a zip archive",
    b"7z\xbc\xaf'\x1c": "a 7z archive",
    b"Rar!": "a rar archive",
    b"\x1f\x9d": "compressed by Unix compress (.Z)",
    b"\x28\xb5\x2f\xfd": "compressed by zstd",
    b"\x04\x22\x4d\x18": "compressed by lz4",
    b"LZIP": "compressed by lzip",
    b"\x5d\x00\x00": "compressed by lzma",
}
_FOREIGN = {
    b"\x89HDF": "an HDF5 or netCDF file",
    **dict.fromkeys((b"CDF\1", b"CDF\2", b"CDF\5"), "a netCDF file"),
    b"%PDF": "a PDF document",
    b"\xd0\xcf\x11\xe0": "a document of an office program",
    b"version https://git-lfs": "the pointer that Git LFS keeps in place of a file (git lfs pull fetches it)",
    b"<?xml": "an XML document, as servers send in place of a file that they refuse",
}
_DAMAGED = (EOFError, gzip.BadGzipFile, lzma.LZMAError, zlib.error, ValueError)  # bz2 raises OSError or ValueError
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_NO_EXPONENT_LETTER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))([+-]\d{3})")  # Fortran drops the letter of 1.5E-103
FORTRAN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)[dD][+-]?\d+")


class InputError(ValueError):
    """A file that cannot be used as it is: one sentence with the file, the line or field, the value, and the cure."""


def counted(count: int, noun: str) -> str:
    """A number of things in words: 1 line, 2 lines."""
    return f"{count} {noun}{'s' * (count != 1)}"


class Place(NamedTuple):
    """Where in a file something stands, for messages; `line` counts from 1, and 0 means the file as a whole."""

    path: Path
    line: int = 0
    kind: type[InputError] = InputError

    def error(self, text: str) -> InputError:
        """The error to raise, beginning with file and line."""
        where = f", line {self.line}" if self.line else ""
        return self.kind(f"{self.path}{where}: {text}")

    def number(self, text: str, what: str = "") -> float:
        """`number(text)`; the error names the place and, where given, `what` the number is."""
        try:
            return number(text)
        except ValueError as error:
            raise self.error(f"{what} {error}".lstrip()) from None

    def integer(self, text: str, what: str = "") -> int:
        """`integer(text)`; the error names the place and, where given, `what` the number is."""
        try:
            return integer(text)
        except ValueError as error:
            raise self.error(f"{what} {error}".lstrip()) from None


def number(text: str) -> float:
    """A finite float as C or Fortran write it: 1.5e-3, 1.5D-03, 1.5-103. Raises ValueError in one sentence."""
    plain = "" if "_" in text else text.strip().replace("\N{MINUS SIGN}", "-")
    try:
        try:
            value = float(plain)
        except ValueError:  # the rare forms are tried last: files have millions of numbers
            split = _NO_EXPONENT_LETTER.fullmatch(plain)
            fortran = plain.upper().replace("D", "E") if FORTRAN.fullmatch(plain) else ""
            value = float(f"{split[1]}e{split[2]}" if split else fortran)
    except ValueError:
        cure = "; the decimal mark is a point" if re.fullmatch(r"[+-]?\d+,\d+", plain) else ""
        raise ValueError(f"{_shown(text)} is not a number{cure}.") from None
    if not math.isfinite(value):
        raise ValueError(f"{_shown(text)} is not finite.")
    return value


def integer(text: str) -> int:
    """A whole number, also where it is written as a float (12.0, 1.2e1). Raises ValueError in one sentence."""
    value = number(text)
    if value != int(value):
        raise ValueError(f"{_shown(text)} is not a whole number.")
    return int(text) if re.fullmatch(r"\s*[+-]?\d+\s*", text) else int(value)


def open_bytes(path: str | os.PathLike, what: str = "file", kind: type[InputError] = InputError) -> IO[bytes]:
    """Open a file for reading bytes, unpacked where its first bytes say gzip, xz or bzip2.

    Parameters
    ----------
    path : path of the file.
    what : what should be there, for messages, e.g. "gravity field".
    kind : class of the error raised.

    Raises
    ------
    FileNotFoundError, IsADirectoryError, PermissionError
        There is no file, or it cannot be read.
    InputError
        An archive that must be unpacked, another kind of file or a web page in place of the data, or a pipe.
    """
    path = Path(path)
    place = Place(path, kind=kind)
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder; give the path of a {what}.")
    if path.exists() and not path.is_file():
        raise place.error(f"this is a pipe or a device, of which only one reading is possible; save it as a {what}.")
    try:
        with open(path, "rb") as stream:
            head = stream.read(512)
    except FileNotFoundError:
        raise FileNotFoundError(f"No {what} at {path}.") from None
    except PermissionError:
        raise PermissionError(f"{path} may not be read; change its permissions.") from None
    _require_data(head, what, place)
    opener = next((opener for magic, opener in _OPENERS.items() if head.startswith(magic)), None)
    if opener is None:
        return open(path, "rb")
    stream = opener(path, "rb")
    try:
        head = stream.read(512)
        if head.startswith(tuple(_OPENERS)):
            raise place.error(f"this is compressed twice; unpack it once and give the {what} inside.")
        _require_data(head, what, place)
        stream.seek(0)
    except InputError:
        stream.close()
        raise
    except (*_DAMAGED, OSError):  # said where it is read
        stream.close()
        stream = opener(path, "rb")
    return stream


def _require_data(head: bytes, what: str, place: Place) -> None:
    """InputError where the first bytes of a file are those of an archive or of another kind of file."""
    for magic, name in _ARCHIVES.items():
        if head.startswith(magic):
            raise place.error(f"this is {name}; unpack it and give the {what} inside.")
    if head[257:262] == b"ustar":
        raise place.error(f"this is a tar archive; unpack it and give the {what} inside.")
    if re.match(rb"(\xef\xbb\xbf)?\s*<(!doctype html|html)", head, re.I):
        raise place.error(f"this is a web page, not a {what}; a log-in page is often saved in place of the data.")
    for magic, name in _FOREIGN.items():
        if head.startswith(magic):
            raise place.error(f"this is {name}, not a {what}.")


def read_bytes(path: str | os.PathLike, what: str = "file", kind: type[InputError] = InputError) -> bytes:
    """The bytes of a file, unpacked, at most `MAX_BYTES`. Raises as `open_bytes`, and InputError for damage or size."""
    with open_bytes(path, what, kind) as stream:
        try:
            content = stream.read(MAX_BYTES + 1)
        except _DAMAGED as error:
            raise _damaged(Path(path), kind, error) from None
        except OSError as error:
            raise _damaged(Path(path), kind, error) if error.errno is None else error from None
    if len(content) > MAX_BYTES:
        raise kind(f"{path}: this holds more than {MAX_BYTES >> 30} GiB; split it.")
    return content


def lines(
    path: str | os.PathLike, what: str = "file", kind: type[InputError] = InputError, keep_ends: bool = False
) -> Iterator[tuple[Place, str]]:
    """Lines of a text file with their places, without their ends unless `keep_ends` (then each ends in "\\n", but the
    last one of a file that was cut).

    Raises as `open_bytes`, and InputError for damage, for bytes that are no text, and for a line beyond `MAX_LINE`.
    """
    path = Path(path)
    count, size = 0, 0
    with open_bytes(path, what, kind) as raw:
        try:
            head = raw.read(4)
            raw.seek(0)
            encoding = "utf-16" if head[:2] in _UTF16 else "utf-8-sig"
            text = io.TextIOWrapper(raw, encoding=encoding, errors="surrogateescape")
            while line := text.readline(MAX_LINE + 1):
                count += 1
                size += len(line)
                place = Place(path, count, kind)
                if size > MAX_BYTES:
                    raise kind(f"{path}: this holds more than {MAX_BYTES >> 30} GiB; split it.")
                if len(line) > MAX_LINE:
                    raise place.error(f"the line is longer than {MAX_LINE} characters; this is no text {what}.")
                if "\0" in line:
                    raise place.error(f"it has a zero byte; this is no text {what}.")
                if "\ufeff" in line or "\x1a" in line:  # byte order marks inside, and what ends a file of DOS
                    line = line.replace("\ufeff", "").replace("\x1a", "")
                yield place, _decoded(line) if keep_ends else _decoded(line).rstrip("\n")
        except InputError:
            raise
        except _DAMAGED as error:
            raise _damaged(path, kind, error, count) from None
        except OSError as error:
            raise _damaged(path, kind, error, count) if error.errno is None else error from None


def _decoded(line: str) -> str:
    """The line itself, or as Latin-1 where it was no UTF-8."""
    if line.isascii() or not any("\udc80" <= letter <= "\udcff" for letter in line):
        return line
    return line.encode("utf-8", "surrogateescape").decode("latin-1")


def _damaged(path: Path, kind: type[InputError], error: Exception, line: int = 0) -> InputError:
    after = f", after line {line}" if line else ""
    if isinstance(error, UnicodeError):
        return kind(f"{path}{after}: the bytes are no UTF-16, as the byte order mark promises; save it as UTF-8.")
    return kind(f"{path}{after}: the file is cut short or damaged ({str(error).rstrip('.')}); fetch it again.")


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
