"""What is read was made for its key, whole, by this user; and nothing that goes wrong on the way to
the disk stops anybody."""

from __future__ import annotations

import ctypes
import errno
import os
import stat
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from stickslip.machine_code import objects, store
from stickslip.machine_code.store import alone, cache_folder, keep, stored

HOUR, DAY = 3600, 86400
OTHER = 65534  # a user who is not root
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes of files")
root = pytest.mark.skipif(
    os.name != "posix" or os.geteuid() != 0, reason="root alone gives files away"
)


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Folders are looked at again, and all their files whenever one is written."""
    monkeypatch.setattr(store, "_SELDOM", 1)
    store._folder.cache_clear()
    yield
    store._folder.cache_clear()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the folder will be."""
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    return tmp_path / "stickslip"


@pytest.fixture
def limited(tmp_path: Path) -> Iterator[Path]:
    """A folder of a user to whom things can be forbidden: root, if it is root, becomes another."""
    if os.geteuid() != 0:
        yield tmp_path
        return
    with tempfile.TemporaryDirectory() as folder:
        os.chown(folder, OTHER, -1)
        os.seteuid(OTHER)
        try:
            if not os.path.exists(folder):
                pytest.skip("other users do not come to temporary folders")
            yield Path(folder)
        finally:
            os.seteuid(0)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def age(path: Path, seconds: float) -> float:
    """Let a file be as old as this."""
    then = float(round(time.time() - seconds))
    os.utime(path, (then, then))
    return then


def python(script: str, *arguments: Any) -> str:
    """What a process prints that knows the store."""
    return started(script, *arguments).communicate()[0]


def started(script: str, *arguments: Any) -> subprocess.Popen[str]:
    head = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from stickslip.machine_code.store import alone, cache_folder, keep, stored\n"
    )
    return subprocess.Popen(
        [sys.executable, "-c", head + script, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def refused(folder: Path, why: str, capsys: pytest.CaptureFixture[str]) -> Path:
    """The folder that stands for one that cannot be used; once it is said why."""
    found = cache_folder()
    assert cache_folder() == found
    (said,) = capsys.readouterr().err.splitlines()
    assert str(folder) in said and why in said and "set STICKSLIP_CACHE" in said
    assert not found.is_relative_to(folder) and not list(found.iterdir())
    if os.name == "posix":
        assert mode(found) == 0o700
    keep(found / "a.o", "a", b"code")
    assert stored(found / "a.o", "a") == b"code"
    return found


# ---- the folder


def test_the_folder_is_the_given_one_else_the_users(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cache_folder() == cache and cache.is_dir()
    monkeypatch.delenv("STICKSLIP_CACHE")
    monkeypatch.setattr(store, "user_cache_path", lambda name: tmp_path / "user" / name)
    assert cache_folder() == tmp_path / "user" / "stickslip"
    assert not list(cache_folder().iterdir())
    assert not capsys.readouterr().err


def test_a_folder_stays_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative path is one of the moment in which it is first asked for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CACHE", "here")
    found = cache_folder()
    monkeypatch.chdir(found)
    assert cache_folder() == found == tmp_path / "here" / "stickslip"


@posix
def test_a_new_folder_is_the_owners_alone(cache: Path) -> None:
    before = os.umask(0)
    try:
        assert mode(cache_folder()) == 0o700
        keep(cache / "a.o", "a", b"code")
        assert mode(cache / "a.o") == 0o600
    finally:
        os.umask(before)


@posix
@pytest.mark.parametrize("before", [0o777, 0o755, 0o770, 0o701])
def test_a_folder_of_ours_is_closed(before: int, cache: Path) -> None:
    cache.mkdir()
    cache.chmod(before)
    assert cache_folder() == cache
    assert mode(cache) == 0o700


@posix
def test_a_folder_that_stays_open_is_refused(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some file systems have no modes."""
    cache.mkdir()
    cache.chmod(0o777)
    monkeypatch.setattr(os, "fchmod", lambda handle, mode: None)
    refused(cache, "others can write to it", capsys)


@root
def test_a_folder_of_another_user_is_refused(
    cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cache.mkdir(mode=0o700)
    os.chown(cache, OTHER, -1)
    refused(cache, "belongs to another user", capsys)
    assert not list(cache.iterdir())


@posix
def test_a_folder_of_another_user_is_refused_also_by_who_is_not_root(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cache.mkdir(mode=0o700)
    with monkeypatch.context() as patch:
        patch.setattr(os, "geteuid", lambda: cache.stat().st_uid + 1)
        found = cache_folder()
    assert not found.is_relative_to(cache)
    assert "belongs to another user" in capsys.readouterr().err


@posix
def test_a_link_to_a_folder_of_ours_is_followed(cache: Path, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    cache.symlink_to(tmp_path / "real")
    assert cache_folder() == cache
    assert mode(tmp_path / "real") == 0o700


@root
@pytest.mark.parametrize("whose", ["folder", "link"])
def test_a_link_of_or_to_another_user_is_refused(
    whose: str, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    real = tmp_path / "real"
    real.mkdir(mode=0o755)
    cache.symlink_to(real)
    os.chown(real if whose == "folder" else cache, OTHER, -1, follow_symlinks=False)
    refused(cache, "belongs to another user", capsys)
    assert mode(real) == 0o755


@posix
@pytest.mark.parametrize("what", ["a file", "a pipe", "a link to nothing"])
def test_what_is_no_folder_is_refused(
    what: str, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if what == "a file":
        cache.write_text("mine")
    elif what == "a pipe":
        os.mkfifo(cache)
    else:
        cache.symlink_to(cache.parent / "nothing")
    refused(cache, "No such" if what == "a link to nothing" else "Not a directory", capsys)
    assert what != "a file" or cache.read_text() == "mine"


@posix
@pytest.mark.parametrize("closed", ["the folder", "its place"])
def test_a_folder_that_cannot_be_written_is_refused(
    closed: str,
    limited: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("STICKSLIP_CACHE", str(limited))
    if closed == "the folder":
        (limited / "stickslip").mkdir(mode=0o500)
    else:
        limited.chmod(0o500)
    found = refused(limited / "stickslip", "Permission denied", capsys)
    (found / "a.o").unlink()
    found.rmdir()  # as the user whom it belongs to


def test_without_a_home_the_folder_is_temporary(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("STICKSLIP_CACHE", raising=False)
    monkeypatch.setattr(store, "user_cache_path", lambda name: Path("~no_such_user/.cache", name))
    refused(Path("~no_such_user/.cache/stickslip"), "home", capsys)


def test_without_any_folder_nothing_is_kept(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def none(**_: Any) -> str:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    cache.write_text("mine")
    monkeypatch.setattr(tempfile, "mkdtemp", none)
    path = cache_folder() / "a.o"
    keep(path, "a", b"code")
    assert stored(path, "a") is None
    with alone(path):
        capsys.readouterr()


def test_a_temporary_folder_goes_with_its_process(cache: Path) -> None:
    cache.write_text("mine")
    script = "folder = cache_folder(); keep(folder / 'a.o', 'a', b'code')\n"
    if os.name == "posix":  # and not with one that was forked
        script += "if os.fork() == 0: sys.exit()\nos.wait()\n"
    there, folder = python(script + "print((folder / 'a.o').exists(), folder)").split(None, 1)
    assert there == "True"
    assert not Path(folder.strip()).exists()


# ---- reading


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with code for the key "a"."""
    keep(tmp_path / "a.o", "a", b"code of a")
    return tmp_path / "a.o"


@pytest.mark.parametrize("code", [b"", b"\0", bytes(range(256)) * 5000])
def test_code_is_kept(code: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.o"
    assert stored(path, "a") is None
    keep(path, "a", b"former")
    keep(path, "a", code)
    assert stored(path, "a") == stored(path, "a", trusted=True) == code
    assert list(tmp_path.iterdir()) == [path]


def test_code_of_another_key_is_none(path: Path) -> None:
    keep(path.with_name("b.o"), "b", b"code of b")
    path.with_name("b.o").replace(path.with_name("swapped.o"))
    path.replace(path.with_name("b.o"))
    path.with_name("swapped.o").replace(path)
    for trusted in (False, True):
        assert stored(path, "a", trusted=trusted) is None
        assert stored(path.with_name("b.o"), "b", trusted=trusted) is None
        assert stored(path, "b", trusted=trusted) == b"code of b"


def test_a_key_ends_where_its_code_begins(path: Path) -> None:
    assert store._head("a", b"bc") != store._head("ab", b"c")
    keep(path, "\udcff é", b"any text is a key")
    assert stored(path, "\udcff é") == b"any text is a key"


def test_machine_code_under_the_name_of_another_does_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was found to give wrong motions with a certificate."""

    def value(number: int) -> int:
        assembly = f"define i64 @number() {{\n  ret i64 {number}\n}}\n"
        monkeypatch.setattr(objects, "_kept", engines)
        monkeypatch.setattr(objects, "cache_folder", lambda: tmp_path)
        (address,) = objects.addresses(assembly, ["number"])
        return ctypes.CFUNCTYPE(ctypes.c_int64)(address)()

    engines = dict[str, Any]()
    assert [value(1), value(2)] == [1, 2]
    first, second = tmp_path.glob("*.o")
    first.replace(tmp_path / "swapped")
    second.replace(first)
    (tmp_path / "swapped").replace(second)
    former, engines = engines, {}  # whose functions live as long as this
    assert [value(1), value(2)] == [1, 2]
    assert len(former) == len(engines) == 2


def test_any_damage_is_noticed(path: Path) -> None:
    whole = path.read_bytes()
    for at in range(len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert stored(path, "a") is None
        path.write_bytes(whole[:at])
        assert stored(path, "a") is None
    path.write_bytes(whole + b"\0")
    assert stored(path, "a") is None
    path.write_bytes(whole)
    assert stored(path, "a") == b"code of a"


def test_a_file_of_no_sane_size_is_neither_read_nor_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = b"0" * 1000
    monkeypatch.setattr(store, "_LARGEST", 999)
    keep(path, "a", code)
    assert stored(path, "a") == b"code of a"
    monkeypatch.setattr(store, "_LARGEST", 2000)
    keep(path, "a", code)
    assert stored(path, "a") == code
    monkeypatch.setattr(store, "_LARGEST", 999)
    assert stored(path, "a") is None


def at_once(read: Callable[[], bytes | None]) -> bytes | None:
    """What is read, if that ends."""
    found = list[bytes | None]()
    thread = threading.Thread(target=lambda: found.append(read()), daemon=True)
    thread.start()
    thread.join(60.0)
    assert not thread.is_alive()
    return found[0]


@posix
@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("trusted", [False, True])
@pytest.mark.parametrize("what", ["pipe", "folder", "device"])
def test_what_is_no_file_is_none(what: str, trusted: bool, linked: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.o"
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    else:
        path = Path("/dev/zero")
    if linked:
        (tmp_path / "link.o").symlink_to(path)
        path = tmp_path / "link.o"
    before = len(os.listdir("/proc/self/fd")) if sys.platform == "linux" else 0
    assert at_once(lambda: stored(path, "a", trusted=trusted)) is None
    assert sys.platform != "linux" or len(os.listdir("/proc/self/fd")) == before


@posix
def test_a_link_is_followed_only_where_the_package_came_with_it(path: Path) -> None:
    """Some installers link to the files of a package."""
    link = path.with_name("link.o")
    link.symlink_to(path)
    assert stored(link, "a") is None
    assert stored(link, "a", trusted=True) == b"code of a"


@posix
@pytest.mark.parametrize("bits", [0o602, 0o620, 0o666])
def test_what_others_can_write_is_none(bits: int, path: Path) -> None:
    path.chmod(0o644)
    assert stored(path, "a") == b"code of a"
    path.chmod(bits)
    assert stored(path, "a") is None
    assert stored(path, "a", trusted=True) == b"code of a"


@root
def test_what_others_wrote_is_none(path: Path) -> None:
    os.chown(path, OTHER, -1)
    assert stored(path, "a") is None
    assert stored(path, "a", trusted=True) == b"code of a"


@posix
def test_what_others_wrote_is_none_also_for_who_is_not_root(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert stored(path, "a") is None
    assert stored(path, "a", trusted=True) == b"code of a"


@posix
def test_what_may_not_be_read_is_none(limited: Path) -> None:
    keep(limited / "a.o", "a", b"code")
    (limited / "a.o").chmod(0o200)
    assert stored(limited / "a.o", "a") is None


@pytest.mark.parametrize("old", [2 * DAY, -2 * DAY])
def test_a_day_is_how_exactly_the_last_use_is_known(old: float, path: Path) -> None:
    then = age(path, HOUR)
    assert stored(path, "a") == b"code of a"
    assert path.stat().st_mtime == then
    age(path, old)
    stored(path, "another key")
    stored(path, "a", trusted=True)  # files of the package stay as they are
    assert abs(path.stat().st_mtime - time.time()) > DAY
    stored(path, "a")
    assert abs(path.stat().st_mtime - time.time()) < DAY


def test_a_file_that_cannot_be_touched_is_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read_only(*_: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    age(path, 2 * DAY)
    monkeypatch.setattr(os, "utime", read_only)
    assert stored(path, "a") == b"code of a"


# ---- writing


def failing(name: str, error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a call of the system do its work, or half of it, and fail."""
    work = getattr(os, name)

    def fail(*given: Any) -> None:
        if name == "write":
            work(given[0], given[1][: len(given[1]) // 2])
        elif name == "close":
            work(*given)
        raise error

    monkeypatch.setattr(os, name, fail)


@pytest.mark.parametrize("name", ["open", "write", "close", "replace"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES])
def test_what_cannot_be_written_is_left(
    name: str, number: int, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        failing(name, OSError(number, os.strerror(number)), patch)
        keep(path, "a", b"new code")
    assert list(path.parent.iterdir()) == [path]
    assert stored(path, "a") == b"code of a"


@pytest.mark.parametrize("name", ["write", "close", "replace"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError()])
def test_nothing_unfinished_stays_of_what_is_interrupted(
    name: str, error: BaseException, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        failing(name, error, patch)
        with pytest.raises(type(error)):
            keep(path, "a", b"new code")
    assert list(path.parent.iterdir()) == [path]
    assert stored(path, "a") == b"code of a"


def test_what_is_written_in_pieces_is_whole(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda handle, data: write(handle, data[:7]))
    keep(path, "a", bytes(range(100)))
    assert stored(path, "a") == bytes(range(100))


@posix
def test_a_full_disk(path: Path) -> None:
    """As far as a limit on the length of files stands for it."""
    script = """
import resource
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
keep(Path(sys.argv[1]), "a", b"0" * 10000)
print("went on")
"""
    assert python(script, path) == "went on\n"
    assert list(path.parent.iterdir()) == [path]
    assert stored(path, "a") == b"code of a"


@posix
def test_what_is_in_the_way_is_replaced_or_left(tmp_path: Path) -> None:
    path, aim = tmp_path / "a.o", tmp_path / "aim"
    os.mkfifo(path)
    keep(path, "a", b"code")
    assert stored(path, "a") == b"code"
    path.unlink()
    aim.write_text("mine")
    path.symlink_to(aim)
    keep(path, "a", b"code")
    assert stored(path, "a") == b"code"
    assert aim.read_text() == "mine"
    path.unlink()
    path.mkdir()
    keep(path, "a", b"code")
    assert path.is_dir()
    assert sorted(tmp_path.iterdir()) == [path, aim]


@posix
def test_into_a_folder_that_cannot_be_written(limited: Path) -> None:
    keep(limited / "a.o", "a", b"code")
    limited.chmod(0o500)
    keep(limited / "a.o", "a", b"new code")
    keep(limited / "b.o", "b", b"code")
    assert [file.name for file in limited.iterdir()] == ["a.o"]
    assert stored(limited / "a.o", "a") == b"code"
    limited.chmod(0o700)


@posix
def test_unfinished_files_are_new_ones(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is written into what has their name already, or where that leads."""
    aim = path.with_name("aim")
    aim.write_text("mine")
    monkeypatch.setattr(os, "urandom", bytes)
    path.with_name(f"stickslip-{bytes(8).hex()}.tmp").symlink_to(aim)
    keep(path, "a", b"new code")
    assert aim.read_text() == "mine"
    assert stored(path, "a") == b"code of a"


def test_into_no_folder(tmp_path: Path) -> None:
    keep(tmp_path / "nothing" / "a.o", "a", b"code")
    assert not list(tmp_path.iterdir())


def test_two_processes_write_one_file(path: Path) -> None:
    """Whoever reads in between finds what one of them wrote."""
    script = "for _ in range(100): keep(Path(sys.argv[1]), 'a', sys.argv[2].encode() * 100_000)"
    codes = {number * 100_000 for number in (b"1", b"23")}
    writers = [started(script, path, number) for number in (1, 23)]
    while any(writer.poll() is None for writer in writers):
        assert stored(path, "a") in {b"code of a", *codes}
    for writer in writers:
        writer.communicate()
        assert writer.returncode == 0
    assert stored(path, "a") in codes
    assert list(path.parent.iterdir()) == [path]


def test_what_killed_processes_left_is_swept(path: Path) -> None:
    left = {
        "stickslip-0123.tmp": 2 * HOUR,
        "stickslip-a.o.lock": 2 * HOUR,
        "stickslip-4567.tmp": HOUR / 2,
        "stickslip-b.o.lock": HOUR / 2,
        "somebody's.tmp": 2 * HOUR,
        "somebody's.lock": 2 * HOUR,
    }
    for name, seconds in left.items():
        path.with_name(name).touch()
        age(path.with_name(name), seconds)
    keep(path, "a", b"code")
    assert {file.name for file in path.parent.iterdir()} == {path.name, *list(left)[2:]}


@posix
def test_a_killed_process_leaves_what_is_swept(path: Path) -> None:
    script = """
os.write = lambda handle, data: os.kill(os.getpid(), signal.SIGKILL)
keep(Path(sys.argv[1]), "a", b"new code")
"""
    python(script, path)
    assert stored(path, "a") == b"code of a"
    (left,) = set(path.parent.iterdir()) - {path}
    age(left, 2 * HOUR)
    keep(path, "a", b"code")
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("limit", [{"_MOST_FILES": 3}, {"_MOST_BYTES": 450}])
def test_what_was_not_used_for_longest_goes(
    limit: dict[str, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = 140 - len(store._head("", b""))
    for name, days in (("a.o", 9), ("b.o", 7), ("c.bc", 8), ("notes.txt", 99)):
        keep(tmp_path / name, name, b"0" * size)
        age(tmp_path / name, days * DAY)
    assert stored(tmp_path / "a.o", "a.o")  # it is used
    for name, value in limit.items():
        monkeypatch.setattr(store, name, value)
    keep(tmp_path / "b.o", "b.o", b"0" * size)  # again: no file more
    age(tmp_path / "b.o", 7 * DAY)
    assert len(list(tmp_path.iterdir())) == 4
    keep(tmp_path / "d.o", "d.o", b"0" * size)
    assert {file.name for file in tmp_path.iterdir()} == {"a.o", "b.o", "d.o", "notes.txt"}
    keep(tmp_path / "e.o", "e.o", b"0" * size)
    assert {file.name for file in tmp_path.iterdir()} == {"a.o", "d.o", "e.o", "notes.txt"}


def test_all_files_are_looked_at_now_and_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process begins with a look, and never lets the folder grow by more than it writes between
    two."""
    monkeypatch.setattr(store, "_MOST_FILES", 3)
    monkeypatch.setattr(store, "_SELDOM", 5)
    monkeypatch.setattr(store, "_WRITTEN", count())
    found = []
    for i in range(16):
        keep(tmp_path / f"{i}.o", "a", b"code")
        found.append(len(list(tmp_path.iterdir())))
    assert found == [1, 2, 3, 4, 5, 3, 4, 5, 6, 7, 3, 4, 5, 6, 7, 3]


def test_what_was_just_written_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever clocks say."""
    monkeypatch.setattr(store, "_MOST_FILES", 1)
    keep(tmp_path / "a.o", "a", b"code")
    age(tmp_path / "a.o", -DAY)
    keep(tmp_path / "b.o", "b", b"code")
    assert stored(tmp_path / "b.o", "b") == b"code"


# ---- locks

HOLD = """
with alone(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.readline()
"""


def lock_of(path: Path) -> Path:
    return path.with_name(f"stickslip-{path.name}.lock")


def test_one_process_waits_for_another(path: Path) -> None:
    holder, order = started(HOLD, path), list[str]()
    assert holder.stdout is not None and holder.stdout.readline() == "held\n"

    def wait() -> None:
        with alone(path):
            order.append("after" if done.is_set() else "before")

    done = threading.Event()
    waiting = threading.Thread(target=wait, daemon=True)
    waiting.start()
    waiting.join(0.2)  # were it not to wait, it would be done long ago
    assert order == []
    done.set()
    holder.communicate("\n")
    waiting.join(60.0)
    assert order == ["after"]
    assert list(path.parent.iterdir()) == [path]


def test_patience_ends(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that stands still stops no other."""
    holder = started(HOLD, path)
    assert holder.stdout is not None and holder.stdout.readline() == "held\n"
    monkeypatch.setattr(store, "_PATIENCE", 0)
    with alone(path):
        assert lock_of(path).exists()
    assert lock_of(path).exists()  # it is the other's
    holder.communicate("\n")
    assert not lock_of(path).exists()


@posix
def test_the_lock_of_a_killed_process_holds_nobody(path: Path) -> None:
    script = "with alone(Path(sys.argv[1])): os.kill(os.getpid(), signal.SIGKILL)"
    python(script, path)
    assert lock_of(path).exists()
    with alone(path):
        pass
    assert list(path.parent.iterdir()) == [path]


def test_a_lock_goes_also_after_an_exception(path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), alone(path):
        raise KeyboardInterrupt
    assert list(path.parent.iterdir()) == [path]


@posix
def test_where_no_lock_can_be_nobody_waits(limited: Path) -> None:
    lock_of(limited / "a.o").mkdir()
    limited.chmod(0o500)
    entered = 0
    for place in (limited / "a.o", limited / "b.o", Path(os.devnull) / "a.o"):
        with alone(place):
            entered += 1
    limited.chmod(0o700)
    assert entered == 3
    assert [file.name for file in limited.iterdir()] == ["stickslip-a.o.lock"]


def test_what_fails_under_a_lock_is_heard_of(path: Path) -> None:
    with pytest.raises(OSError, match="mine"), alone(path):
        raise OSError("mine")
