"""What the build adds: the engine's machine code in the wheel, and the addresses of the project."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).parent
SOURCE = ROOT / "src"
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?![a-z]+:|#)([^)\s]+)\)")


class MachineCode(BuildHookInterface):
    """Compiles the engine for all processors before a wheel is packed, unless ``$STICKSLIP_SHIPS``
    is ``none``: then what is there is packed. An editable installation compiles it for its own
    processor when it first needs it.

    A wheel contains machine code for the platform on which it is built, and bitcode for others.
    ``$STICKSLIP_WHEEL_PLATFORM``, such as ``manylinux_2_28_x86_64``, names the platform in its tag,
    so that an index can offer a wheel with machine code for each."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make what is missing."""
        if version != "standard":
            return
        levels = os.environ.get("STICKSLIP_SHIPS", "all")
        if levels != "none":
            paths = [str(SOURCE), *filter(None, [os.environ.get("PYTHONPATH")])]
            subprocess.run(
                [sys.executable, "-m", "stickslip.machine_code.shipping", levels],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                check=True,
            )
        platform = os.environ.get("STICKSLIP_WHEEL_PLATFORM")
        if platform:
            build_data["tag"] = f"py3-none-{platform}"
            build_data["pure_python"] = False


class Addresses(MetadataHookInterface):
    """Derives the addresses of the project from that of its repository, and makes the links of the
    README absolute, since a package index shows it without the repository."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set ``urls`` and ``readme``."""
        repository = self.config["repository"]
        metadata["urls"] = urls(repository)
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": with_absolute_links(text, repository, f"v{metadata['version']}"),
        }


def urls(repository: str) -> dict[str, str]:
    """The addresses of the project, by the names under which an index shows them."""
    owner, name = urlsplit(repository).path.strip("/").split("/")
    return {
        "Homepage": repository,
        "Documentation": f"https://{owner.lower()}.github.io/{name}/",
        "Source": repository,
        "Issues": f"{repository}/issues",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
        "Security": f"{repository}/security/policy",
    }


def with_absolute_links(text: str, repository: str, tag: str) -> str:
    """A text whose relative links and pictures are those of a tag of the repository."""

    def absolute(found: re.Match[str]) -> str:
        picture, words, place = found.groups()
        kind = "raw" if picture else "tree" if (ROOT / place).is_dir() else "blob"
        return f"{picture}[{words}]({repository}/{kind}/{tag}/{place})"

    return _LINK.sub(absolute, text)
