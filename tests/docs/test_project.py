"""What the project says about itself in several files agrees."""

import re
import tomllib

import yaml

from tests.docs.documents import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_license_version_and_authors_are_the_same_everywhere():
    license_text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in license_text
    assert "Version 2.0, January 2004" in license_text
    assert PROJECT["license"] == CITATION["license"] == "Apache-2.0"
    assert PROJECT["license-files"] == ["LICENSE"]
    assert PROJECT["version"] == CITATION["version"]
    (author,) = PROJECT["authors"]
    assert author["name"] == CITATION["authors"][0]["name"]
    assert f"Copyright 2026 {author['name']}" in license_text


def test_the_citation_dates_the_released_version_and_names_the_paper():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {CITATION['version']} ({CITATION['date-released']})" in changelog
    assert CITATION["cff-version"] == "1.2.0"
    (paper,) = CITATION["references"]
    assert [author["family-names"] for author in paper["authors"]] == ["Li", "Zeng", "Si"]
    assert paper["title"] in re.sub(r"\s+", " ", (ROOT / "README.md").read_text(encoding="utf-8"))


def test_every_package_of_an_extra_is_pinned():
    pinned = {line.partition("==")[0].lower().replace("_", "-") for line in (ROOT / "constraints.txt").read_text().split()}
    wanted = [*PROJECT["dependencies"], *(name for extra in PROJECT["optional-dependencies"].values() for name in extra)]
    names = {re.split(r"[\[<>=;]", name)[0].lower() for name in wanted} - {"hippodrome"}
    assert names <= pinned, names - pinned


def test_hooks_need_no_network_and_run_tools_of_the_environment():
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    (local,) = hooks["repos"]
    assert local["repo"] == "local"
    tools = {"hippodrome", *(re.split(r"[\[<>=]", name)[0] for name in PROJECT["optional-dependencies"]["dev"])}
    for hook in local["hooks"]:
        assert hook["language"] == "system"
        (tool,) = re.findall(r"^\.venv/bin/(\w+)", hook["entry"])
        assert tool in tools
