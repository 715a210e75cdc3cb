"""The pages: they are built without a warning, hold everything, and need no network to be read."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.docs.documents import ROOT, documents

FETCHED = re.compile(
    r"<(?:script|img|iframe|source|video)\b[^>]*\bsrc=\"?(?:https?:)?//[^\s\">]+|<link\b[^>]*\bhref=\"?(?:https?:)?//[^\s>]+>"
)
NOT_FETCHED = re.compile(r"rel=\"?(?:canonical|next|prev)")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """As `make site` builds it, elsewhere."""
    folder = tmp_path_factory.mktemp("site")
    subprocess.run([sys.executable, ROOT / "docs/site/make.py", folder / "sources"], check=True)
    config = (
        (ROOT / "mkdocs.yml").read_text(encoding="utf-8").replace("docs_dir: out/site-sources", f"docs_dir: {folder / 'sources'}")
    )
    config = config.replace("site_dir: out/site", f"site_dir: {folder / 'pages'}").replace("[.ns]", f"[{ROOT / '.ns'}]")
    config = config.replace("docs/site/field_comments.py", str(ROOT / "docs/site/field_comments.py"))
    (folder / "mkdocs.yml").write_text(config)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", folder / "mkdocs.yml"]
    offline = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}  # nothing answers there
    built = subprocess.run(command, env=os.environ | offline, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr[-3000:]
    return folder / "pages"


def test_every_document_is_a_page(site):
    names = {"README.md": "index.html", "CONTRIBUTING.md": "contributing.html"}
    for page in documents():
        assert (site / names.get(str(page), f"{page.path.stem}.html")).is_file()
    assert (site / "changelog.html").is_file()


def test_every_page_is_in_the_navigation():
    class Loader(yaml.SafeLoader):
        """Reads the one Python name of the file as nothing."""

    Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda loader, suffix, node: None)
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    named = set(re.findall(r"[\w/-]+\.md", str(yaml.load(text, Loader)["nav"])))
    assert {page.path.name for page in documents() if page.path.parent.name == "docs"} <= named


def test_the_reference_has_the_front_door_and_every_room_of_core(site):
    import hippodrome

    door = (site / "reference/index.html").read_text(encoding="utf-8")
    for name in set(hippodrome.__all__) - {"__version__"}:
        assert re.search(rf"id=\"?hippodrome\.[\w.]+\.{name}[\"\s>]", door), name
    rooms = {path.name for path in (ROOT / "core").iterdir() if path.is_dir() and list(path.rglob("*.py"))}
    assert {path.stem for path in (site / "reference").glob("*.html")} == rooms | {"index", "core"}


def test_fields_are_described_by_their_comments(site):
    page = (site / "reference/roads.html").read_text(encoding="utf-8")
    assert "RoadNetwork" in page
    assert re.search(r"point_start.{0,600}\(L \+ 1,\)", page, flags=re.DOTALL)


def test_nothing_is_fetched_when_a_page_is_read(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    for path in pages:
        found = [tag for tag in FETCHED.findall(path.read_text(encoding="utf-8")) if not NOT_FETCHED.search(tag)]
        assert not found, f"{path.name}: {found}"
    for path in Path(site / "site").glob("*.css"):
        assert "http" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "broken", ["[x](nowhere.md)", "[x](metrics.md#no-such-part)", "![x](no-picture.png)", "::: hippodrome.core.no_such_module"]
)
def test_what_leads_nowhere_fails_the_build(site, broken, tmp_path):
    """On one small page, for speed."""
    config = (site.parent / "mkdocs.yml").read_text().partition("\nnav:")[0].replace(str(site.parent), str(tmp_path))
    (tmp_path / "mkdocs.yml").write_text(config)
    sources = tmp_path / "sources"
    sources.mkdir()
    (sources / "index.md").write_text(f"# One\n\n{broken}\n")
    (sources / "metrics.md").write_text("# Two\n")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", tmp_path / "mkdocs.yml"]
    assert subprocess.run(command, capture_output=True).returncode != 0
    (sources / "index.md").write_text("# One\n\n[x](metrics.md#two)\n")
    assert subprocess.run(command, capture_output=True).returncode == 0
