"""AUTO-07p as a rival: the Fortran file is compiled, run on its constants, and its tables are
read."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

LIBRARY = Path("/usr/lib/auto-07p/lib")  # where Debian's package puts it
SOURCE = Path(__file__).parent / "auto" / "slider.f90"
EQUILIBRIA = """NDIM=2, IPS=1, IRS=0, ILP=1
ICP=[1]
NTST=50, NCOL=4, IAD=3, ISP=2, ISW=1, IPLT=0, NBC=0, NINT=0
NMX=300, NPR=1000, MXBF=0, IID=2, ITMX=8, ITNW=7, NWTN=3, JAC=0
EPSL=1e-12, EPSU=1e-12, EPSS=1e-10
DS=-0.005, DSMIN=1e-6, DSMAX=0.02, IADS=1
UZSTOP={1:[0.02,0.51]}
"""
CYCLES = """NDIM=2, IPS=2, IRS=2, ILP=1
ICP=[1,11]
NTST=%d, NCOL=4, IAD=3, ISP=2, ISW=1, IPLT=0, NBC=0, NINT=0
NMX=2000, NPR=5000, MXBF=0, IID=2, ITMX=8, ITNW=7, NWTN=3, JAC=0
EPSL=1e-10, EPSU=1e-10, EPSS=1e-8
DS=0.01, DSMIN=1e-8, DSMAX=0.1, IADS=1
UZR={1:[%s]}
UZSTOP={1:[0.02,0.51]}
"""


@dataclass(frozen=True)
class Row:
    """A point of a branch: AUTO's type, V, the period (0 of an equilibrium), its two
    multipliers."""

    kind: int
    V: float
    period: float
    multipliers: tuple[complex, ...]


def absent() -> str:
    """Why there is no AUTO here, or an empty text."""
    if not (LIBRARY / "main.o").is_file():
        return "AUTO-07p is not installed (Debian package auto-07p)"
    return "" if shutil.which("gfortran") else "gfortran is not installed (Debian package gfortran)"


class Auto:
    """A compiled problem in a folder of its own."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.folder = Path(self._folder.name)
        objects = sorted(map(str, LIBRARY.glob("*.o")))
        command = ["gfortran", "-O2", "-fopenmp", str(SOURCE), *objects, "-o", "slider"]
        subprocess.run(command, cwd=self.folder, check=True, capture_output=True)

    def equilibria(self) -> tuple[float, list[Row]]:
        """Seconds and the branch from V = 0.5 down to 0.02."""
        (self.folder / "fort.3").unlink(missing_ok=True)
        return self._run(EQUILIBRIA)

    def cycles(self, intervals: int, stops: list[float]) -> tuple[float, list[Row]]:
        """Seconds and the branch from the Hopf point, which `equilibria` has found, down to V =
        0.02."""
        if not (self.folder / "hopf").is_file():
            self.equilibria()
            shutil.copy(self.folder / "fort.8", self.folder / "hopf")
        shutil.copy(self.folder / "hopf", self.folder / "fort.3")
        return self._run(CYCLES % (intervals, ",".join(map(str, stops))))

    def _run(self, constants: str) -> tuple[float, list[Row]]:
        (self.folder / "fort.2").write_text(constants)
        began = time.perf_counter()
        subprocess.run(
            ["./slider"],
            cwd=self.folder,
            check=True,
            capture_output=True,
            env={"OMP_NUM_THREADS": "1"},
        )
        spent = time.perf_counter() - began
        return spent, self._rows()

    def _rows(self) -> list[Row]:
        found: dict[int, list[complex]] = {}
        pattern = re.compile(r"^ +\d+ +(\d+) +Multiplier +\d+ +(\S+) +(\S+)", re.MULTILINE)
        for point, real, imaginary in pattern.findall((self.folder / "fort.9").read_text()):
            found.setdefault(int(point), []).append(complex(number(real), number(imaginary)))
        rows = []
        for line in (self.folder / "fort.7").read_text().splitlines():
            words = line.split()
            if words[0] == "0":
                continue
            point = abs(int(words[1]))
            kind = int(words[2])
            period = float(words[8]) if len(words) > 8 else 0.0
            rows.append(Row(kind, float(words[4]), period, tuple(found.get(point, ()))))
        return rows


def number(text: str) -> float:
    """A number of Fortran, which drops the E of an exponent with three digits."""
    return float(re.sub(r"(?<=\d)([+-]\d{3})$", r"E\1", text))
