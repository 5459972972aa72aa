"""What the site of the documentation takes from outside docs/: the README as its first page, and what pages link to.

MkDocs calls these functions; see mkdocs.yml.
"""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent

#: Pages from files beside docs/.
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}

_LINK = re.compile(r"(\]\()([^)#:\s]+)((?:#[^)\s]*)?\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and the specs that lie beside docs/."""
    for name, page in PAGES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_LINK.sub(_from_root, text)))
    for spec in sorted((ROOT / "specs").rglob("*.yaml")):
        files.append(File.generated(config, spec.relative_to(ROOT).as_posix(), abs_src_path=str(spec)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to files beside docs/ lead to their pages."""
    return _LINK.sub(_from_docs, markdown)


def _from_root(link: re.Match[str]) -> str:
    target = PAGES.get(link[2], link[2].removeprefix("docs/"))
    return f"{link[1]}{target}{link[3]}"


def _from_docs(link: re.Match[str]) -> str:
    target = link[2].removeprefix("../")
    return f"{link[1]}{PAGES.get(target, target)}{link[3]}"
