"""No code path that only one operating system has."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import stickslip
import stickslip_paper

ROOTS = [Path(str(module.__file__)).parent for module in (stickslip, stickslip_paper)]
FILES = [path for root in ROOTS for path in sorted(root.rglob("*.py"))]
MODULES = {"fcntl", "pwd", "grp", "resource", "termios", "posix", "pty", "tty", "syslog"}
ATTRIBUTES = {
    "fork", "forkpty", "getuid", "geteuid", "getpgid", "setsid", "killpg", "mkfifo", "nice",
    "sched_getaffinity", "sched_setaffinity", "uname", "SIGKILL", "SIGALRM", "SIGUSR1", "SIGHUP",
    "alarm", "setitimer",
}  # fmt: skip
# Where it is asked first which system this is, or nothing is done if there is no such place.
GUARDED = {"store.py": {"geteuid"}, "ptx.py": {"/usr/local/cuda"}}
PLACES = ("/proc/", "/dev/", "/tmp", "/usr/", "/etc/", "/sys/")


def suspects(code: str) -> Iterator[str]:
    """What only some systems have: modules, functions, places, and files read in the encoding that
    the system happens to like. A module that may be missing is one that is done without."""
    tree = ast.parse(code)
    spared = {id(part) for node in ast.walk(tree) for part in _done_without(node)}
    for node in ast.walk(tree):
        match node:
            case ast.Import() if id(node) in spared:
                pass
            case ast.Import(names=names):
                yield from (a.name for a in names if a.name.partition(".")[0] in MODULES)
            case ast.ImportFrom(module=str(name)) if name.partition(".")[0] in MODULES:
                yield name
            case ast.Attribute(value=ast.Name(id="os" | "signal"), attr=name) if name in ATTRIBUTES:
                yield name
            case ast.Constant(value=str(text)) if text.startswith(PLACES):
                yield text
            case ast.Call(func=ast.Attribute(attr="read_text" | "write_text"), keywords=given):
                if "encoding" not in {k.arg for k in given}:
                    yield "a text without encoding"


def _done_without(node: ast.AST) -> list[ast.stmt]:
    """What is tried where its absence is answered."""
    match node:
        case ast.Try(handlers=[ast.ExceptHandler(type=ast.Name(id="ImportError"))]):
            return node.body
    return []


def test_code_runs_everywhere() -> None:
    for path in FILES:
        found = set(suspects(path.read_text(encoding="utf-8")))
        assert found <= GUARDED.get(path.name, set()), path


def test_suspects_are_found() -> None:
    code = """
import fcntl, os
try:
    import resource
except ImportError:
    resource = None
os.fork(); os.kill(1, signal.SIGKILL)
open("/proc/self/status"); Path("a").read_text()
"""
    assert set(suspects(code)) == {
        "fcntl",
        "fork",
        "SIGKILL",
        "/proc/self/status",
        "a text without encoding",
    }
