"""A cache of machine code on disk, whose entries are verified before they are used.

A file holds the format, a hash of its key and its code, and the code. The key is a text: all that
the code depends on, or a hash of it. A file with another key, a damaged file, and in the cache one
that somebody else could have written are ignored, and the code is generated again. A full disk is
no error: code that cannot be written is generated each time.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from itertools import count
from pathlib import Path
from threading import RLock

from filelock import FileLock
from platformdirs import user_cache_path

CODE_FORMAT = b"stickslip code 1\n"
_DIGEST = 32  # bytes
_LARGEST = 2**28  # largest number of bytes of a file
# Limits of these files in a folder; the most recently read ones are kept.
_MOST_FILES, _MOST_BYTES = 2000, 2**29
_SELDOM = 32  # files that a process writes from one look at all of them to the next
_CODE = (".o", ".bc", ".list", ".ptx", ".cubin")
_PASSING = "stickslip-"  # prefix of the names of locks and of unfinished files
_PATIENCE = 600  # seconds to wait for a lock
_HOUR, _DAY = 3600, 86400
_POSIX = os.name == "posix"
_LOCK = RLock()
_WRITTEN = count()


def _flags(*names: str) -> int:
    """Flags for opening files, as far as this system has them."""
    return sum(getattr(os, name, 0) for name in names)


_READING = _flags("O_RDONLY", "O_BINARY", "O_NONBLOCK", "O_NOCTTY")
_WRITING = _flags("O_WRONLY", "O_BINARY", "O_CREAT", "O_EXCL")


def cache_folder() -> Path:
    """Folder of machine code: in ``$STICKSLIP_CACHE``, else the user's cache folder; a temporary
    one, for this process, where that is not the user's alone or cannot be written."""
    with _LOCK:
        return _folder(os.environ.get("STICKSLIP_CACHE"))


@cache
def _folder(given: str | None) -> Path:
    folder = Path(given) / "stickslip" if given else user_cache_path("stickslip")
    try:
        folder = folder.expanduser().absolute()
        _claim(folder)
        return folder
    except (OSError, RuntimeError) as error:  # RuntimeError: the home folder is not known
        why = getattr(error, "strerror", None) or error
        print(
            f"stickslip: machine code cannot be stored in {folder}: {why}. A temporary folder is "
            "used for this process only. Change the owner of the folder, or set STICKSLIP_CACHE "
            "to another folder.",
            file=sys.stderr,
        )
    try:
        private = tempfile.mkdtemp(prefix="stickslip-")
    except OSError:
        return Path(os.devnull)  # it can neither store nor provide files
    atexit.register(_discard, private, os.getpid())
    return Path(private)


def _claim(folder: Path) -> None:
    """Make a folder accessible to this user only; raises an `OSError` with the reason if that is
    impossible, or if the folder is not writable."""
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if _POSIX:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            status, me = os.fstat(handle), os.geteuid()
            if status.st_uid != me or os.lstat(folder).st_uid not in (me, 0):  # lstat: the link
                raise OSError("it belongs to another user")
            if status.st_mode & 0o077:
                os.fchmod(handle, stat.S_IMODE(status.st_mode) & ~0o077)
            if os.fstat(handle).st_mode & 0o022:  # some file systems do not support modes
                raise OSError("others can write to it")
        finally:
            os.close(handle)
    with _unfinished(folder, b""):
        pass


def _discard(folder: str, process: int) -> None:
    """Remove a temporary folder, but not in a process that was forked."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def stored(path: Path, key: str, *, trusted: bool = False) -> bytes | None:
    """Code of a file; None if it holds none for this key. A trusted file came with the package: it
    may belong to anybody, and be a link."""
    try:
        handle = os.open(path, _READING if trusted else _READING | _flags("O_NOFOLLOW"))
    except OSError:
        return None
    try:
        status = os.fstat(handle)
        if not _may_be_read(status, trusted):
            return None
        with open(handle, "rb", closefd=False) as file:
            found = file.read(status.st_size)
        code = found[len(CODE_FORMAT) + _DIGEST :]
        if found != _head(key, code) + code:
            return None
        if not trusted and abs(time.time() - status.st_mtime) > _DAY:
            with suppress(OSError):  # time of the last use; access times are often not recorded
                os.utime(handle if os.utime in os.supports_fd else path)
        return code
    except OSError:
        return None
    finally:
        os.close(handle)


def _may_be_read(status: os.stat_result, trusted: bool) -> bool:
    """Whether this is a regular file that no other user could have written."""
    if not stat.S_ISREG(status.st_mode) or status.st_size > _LARGEST:
        return False
    return trusted or not _POSIX or (status.st_uid == os.geteuid() and not status.st_mode & 0o022)


def _head(key: str, code: bytes) -> bytes:
    """Header of a file of machine code."""
    bound = hashlib.sha256(key.encode("utf-8", "surrogatepass")).digest()
    return CODE_FORMAT + hashlib.sha256(bound + code).digest()


def keep(path: Path, key: str, code: bytes) -> None:
    """Keep code for :func:`stored`, whole or not at all."""
    content = _head(key, code) + code
    if len(content) <= _LARGEST:
        with suppress(OSError):
            with _unfinished(path.parent, content) as unfinished:
                os.replace(unfinished, path)
            if next(_WRITTEN) % _SELDOM == 0:
                _tidy(path)


@contextmanager
def _unfinished(folder: Path, content: bytes) -> Iterator[Path]:
    """A new file that is gone in the end, if it still has this name."""
    path = folder / f"{_PASSING}{os.urandom(8).hex()}.tmp"
    try:
        handle = os.open(path, _WRITING, 0o600)
        try:
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(handle, rest) :]
        finally:
            os.close(handle)
        yield path
    finally:
        _remove(path)


def _remove(path: str | Path) -> None:
    with suppress(OSError):
        os.unlink(path)


def _tidy(latest: Path) -> None:
    """Remove files that killed processes have left in the folder of a file and, if the folder is
    too large, the code that was not used for the longest time."""
    codes: list[tuple[float, int, str]] = []
    with os.scandir(latest.parent) as entries:
        for entry in entries:
            passing = entry.name.startswith(_PASSING)
            if passing or entry.name.endswith(_CODE):
                with suppress(OSError):  # another process may just have removed it
                    status = entry.stat(follow_symlinks=False)
                    if not passing:
                        codes.append((status.st_mtime, status.st_size, entry.name))
                    elif time.time() - status.st_mtime > _HOUR:
                        _remove(entry.path)
    size = 0
    for rank, (_, length, name) in enumerate(sorted(codes, reverse=True)):
        size += length
        if (rank >= _MOST_FILES or size > _MOST_BYTES) and name != latest.name:
            _remove(latest.parent / name)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Keep other processes from compiling the same file; if no lock is available in time, it is
    compiled twice."""
    place = path.with_name(f"{_PASSING}{path.name}.lock")
    with ExitStack() as stack:
        with suppress(OSError, NotImplementedError):
            stack.enter_context(FileLock(place, timeout=_PATIENCE))
            stack.callback(_remove, place)  # while it is held
        yield
