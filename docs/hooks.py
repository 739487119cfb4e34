"""Pages that stand outside docs/ in the repository become pages of the site, links included."""

import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File

# Where a page stands in the repository, and on the site.
OUTSIDE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "benchmarks/README.md": "measuring.md",
}
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)")


def on_files(files, config):
    root = Path(config.config_file_path).parent
    for source, page in OUTSIDE.items():
        content = (root / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=content))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links as the repository has them, seen from the page on the site."""
    sources = {there: here for here, there in OUTSIDE.items()}
    uri = page.file.src_uri
    folder = posixpath.dirname(sources.get(uri, f"docs/{uri}"))

    def moved(link):
        target = posixpath.normpath(posixpath.join(folder, link[1]))
        target = OUTSIDE.get(target, target.removeprefix("docs/"))
        return f"]({posixpath.relpath(target, posixpath.dirname(uri) or '.')}"

    return LINK.sub(moved, markdown)
