"""Print the lowest versions that the package declares, as constraints for pip: of what users
install, not of what tests and documentation need besides."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
# The compiler of a GPU has no release of the version that its bound names, and no test needs it.
LEFT_OUT = ("test", "docs", "examples", "benchmark", "gpu")


def lowest() -> dict[str, str]:
    """The lower bound of each package that users install."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"]]
    wanted += [text for name, own in extras.items() if name not in LEFT_OUT for text in own]
    found: dict[str, str] = {}
    for text in wanted:
        bound = re.fullmatch(r"([\w.-]+)(?:\[[\w,]+\])?>=([\w.]+)", text.partition(";")[0].strip())
        if bound:
            found[bound[1]] = bound[2]
    return found


if __name__ == "__main__":
    print("\n".join(f"{name}=={bound}" for name, bound in lowest().items()))
