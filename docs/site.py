"""What the site of the documentation takes from outside docs/: the README as its first page, what pages link to, and
the panels in which the systems of the gallery run.

MkDocs calls these functions; see mkdocs.yml.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from phigen import resources
from phigen import spec as specs
from phigen.compiler import compile_spec
from phigen.report.panel import NoPanelError, panel_page

ROOT = Path(__file__).resolve().parent.parent

#: Pages from files beside docs/.
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}

#: The systems whose panels are made, where not all are wanted.
CHOSEN = os.environ.get("PHIGEN_PANELS")

_HEADING = re.compile(r"^## (\w+)$", re.MULTILINE)
_LINK = re.compile(r"(\]\()([^)#:\s]+)((?:#[^)\s]*)?\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and the specs that lie beside docs/."""
    for name, page in PAGES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_LINK.sub(_from_root, text)))
    for spec in sorted((ROOT / "specs").rglob("*.yaml")):
        files.append(File.generated(config, spec.relative_to(ROOT).as_posix(), abs_src_path=str(spec)))
    for name, html in panels().items():
        files.append(File.generated(config, f"live/{name}.html", content=html))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to files beside docs/ lead to their pages; the gallery gets the panels."""
    if page.file.src_uri == "gallery.md":
        markdown = "".join(_with_panels(markdown))
    return _LINK.sub(_from_docs, markdown)


@cache
def panels() -> dict[str, str]:
    """The pages of the panels by the names of the systems: of the longest run, as in the gallery."""
    pages = {}
    for name, path in resources.bundled().items():
        if CHOSEN is None or name in CHOSEN.split():
            spec = specs.load(path)
            with suppress(NoPanelError):
                pages[name] = panel_page(compile_spec(spec), max(spec.runs.values(), key=lambda run: run.steps))
    return pages


def _with_panels(markdown: str) -> Iterator[str]:
    """The gallery with a panel before the figure of each system that has one."""
    begin, *parts = _HEADING.split(markdown)
    yield begin
    for name, text in zip(parts[::2], parts[1::2], strict=True):
        introduction, figure, following = text.partition("\n![")
        panel = f'\n<details data-live="live/{name}.html"><summary>Run it here, beside RK4</summary></details>\n'
        yield f"## {name}{introduction}{panel if name in panels() else ''}{figure}{following}"


def _from_root(link: re.Match[str]) -> str:
    target = PAGES.get(link[2], link[2].removeprefix("docs/"))
    return f"{link[1]}{target}{link[3]}"


def _from_docs(link: re.Match[str]) -> str:
    target = link[2].removeprefix("../")
    return f"{link[1]}{PAGES.get(target, target)}{link[3]}"
