"""What the documents name exists, and is used by more than tests: paths, Python names, keys, files of results, links, figures."""

import ast
import re
from functools import cache
from importlib import import_module

import pytest
import yaml

from hippodrome.eval.authoring.keys import scenario_keys
from hippodrome.eval.results.model import LocalizationSummary
from hippodrome.sim.scenario import load_scenario
from tests.docs.documents import ROOT, code_in, document, documents

DOCUMENTS = pytest.mark.parametrize("page", documents(), ids=str)
PARTS = ("core", "sim", "proto", "eval")
PATH = re.compile(r"(?<![\w/.-])((?:core|eval|sim|proto|scenarios|tests|docs|benchmarks|examples|\.ns)/[\w./*-]*)")
WORD = re.compile(r"[A-Za-z_][\w-]*")
FILE = re.compile(r"[\w*./<>-]*\.(?:json|md|tum|npz|html|png|txt|csv|osa|zip|pbstream|yml|yaml|toml|cff|py|proto|xml|gz|osm)")
DRIVES = re.compile(r"^localization\.(tour|traffic|ego|conditions)\b")  # keys as those of mapping
FOREIGN = {  # names of other programs' things, and of the Python language
    "netedit", "evo_ape", "evo_rpe", "evo_res", "evo_traj", "uint8", "numpy.random.Generator", "Args", "Returns", "Raises",
    "TMPDIR",
}  # fmt: skip
PLACEHOLDERS = {"SCENARIO", "METHOD", "RUN", "NN", "KEY", "NEW_DIR", "NUMBER", "N", "FILE", "NAME", "FOLDER", "SOURCE", "DIR"}
OF_A_READER = {  # files that a reader has, makes, or is shown as an example
    "my_town.osm", "my-town.yaml", "my-town.net.xml.gz", "my-town", "town.yaml", "town.net.xml", "map.osm", "FILE.csv",
    "my_module.py", "./run.sh", "run.sh", "./stream_client",
    "FILE.tum", "FILE.rrd", "topometric*-ape.zip", "wheels.csv",
}  # fmt: skip
DENSITIES = {"belief", "belief_2d"}  # Eqs. (1) and (2): the networks carry these densities' parameters, tests hold them to SciPy


# --- paths and links


@DOCUMENTS
def test_every_path_exists(page):
    without_links = re.sub(r"https?://\S+", "", page.unfenced)
    for path in PATH.findall(without_links):
        path = path.rstrip(".").rstrip("*") if path.endswith("...") else path.rstrip(".")
        assert list(ROOT.glob(path.rstrip("/"))), f"{page}: {path}"


@DOCUMENTS
def test_every_link_leads_somewhere(page):
    for link in page.links:
        if link.startswith(("http://", "https://")):
            continue
        target, _, anchor = link.partition("#")
        path = (page.path.parent / target).resolve() if target else page.path
        assert path.exists(), f"{page}: {link}"
        if anchor:
            assert anchor in document(path.relative_to(ROOT).as_posix()).anchors, f"{page}: {link}"


@DOCUMENTS
def test_every_document_is_read_on_from_the_readme(page):
    readme = document("README.md")
    assert page.path == readme.path or str(page) in readme.links, f"{page}: the README has no link to it"


# --- Python names


@cache
def sources():
    """The text of everything that is not a test or a document, by path."""
    files = [path for part in (*PARTS, "benchmarks", ".ns/hippodrome") for path in (ROOT / part).rglob("*") if path.is_file()]
    files += [ROOT / name for name in ("pyproject.toml", "Makefile", "constraints.txt")]
    return {
        path: path.read_text(encoding="utf-8")
        for path in files
        if path.suffix in {".py", ".js", ".css", ".proto", ".toml", "", ".txt"}
    }


@cache
def defined_in(path):
    """Names at the top level of a module."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return names


@cache
def trees():
    return {path: ast.parse(text) for path, text in sources().items() if path.suffix == ".py"}


@cache
def functions():
    """Names of all functions and methods of the sources."""
    return {node.name for tree in trees().values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@cache
def used():
    """Names that the sources import, read or call; what is merely defined, or only tests use, is not among them."""
    names = set()
    for tree in trees().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.Name):
                names.add(node.id)
            elif isinstance(node, ast.Attribute):
                names.add(node.attr)
            elif isinstance(node, ast.ImportFrom):
                names |= {alias.name for alias in node.names}
    return names


@cache
def word_count(word):
    """How often a word stands in the sources."""
    return sum(len(re.findall(rf"(?<![\w-]){re.escape(word)}(?![\w-])", text)) for text in sources().values())


def rows_with_functions():
    for table in document("docs/algorithms.md").tables():
        for row in table:
            if row.get("functions"):
                files = [ROOT / path for cell in ("file", "files") for path in code_in(row.get(cell, ""))]
                yield pytest.param(files, code_in(row["functions"]), id=row.get("what", ""))


@pytest.mark.parametrize(("files", "names"), list(rows_with_functions()))
def test_the_functions_of_an_equation_are_in_the_file_named_and_are_used(files, names):
    assert files
    defined = set().union(*(defined_in(path) for path in files))
    for name in names:
        assert name in defined, f"{name} is not in {', '.join(path.name for path in files)}"
        assert name in DENSITIES | used(), f"{name}: only tests call it"


def test_the_equations_of_the_paper_are_all_there():
    """(1) to (16) are each in a row of the tables."""
    named = set()
    for table in document("docs/algorithms.md").tables():
        for row in table:
            for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", row.get("what", "")):
                named |= set(range(int(first), int(last or first) + 1))
    assert named == set(range(1, 17))


@DOCUMENTS
def test_dotted_python_names_can_be_had(page):
    for code in page.inline:
        name = code.partition("(")[0]
        if re.fullmatch(r"(hippodrome\.)?(core|sim|proto|eval|benchmarks)(\.\w+)+|hippodrome\.\w+", name):
            name = name if name.startswith(("hippodrome", "benchmarks")) else f"hippodrome.{name}"
            assert _resolved(name), f"{page}: {name}"


def _resolved(name):
    module, _, attribute = name.rpartition(".")
    try:
        import_module(name)
    except ModuleNotFoundError:
        return hasattr(import_module(module), attribute)
    return True


@DOCUMENTS
def test_every_name_is_in_the_sources(page):
    """A word set as code stands in the code, too: a class, function, field, key, value, mode, method, file of results."""
    for code in page.inline:
        name = code.partition("(")[0] if code.endswith(")") else code
        if not WORD.fullmatch(name) or name in FOREIGN | PLACEHOLDERS:
            continue
        if name.startswith("_") or re.search(r"-(\d+|N)$", name):  # a unit's suffix; a numbered name
            piece = re.sub(r"-(\d+|N)$", "-{", name)
            assert any(piece in text for text in sources().values()), f"{page}: {code}"
        else:
            assert word_count(name) or (ROOT / name).exists(), f"{page}: {code}"
        assert name not in functions() or name in DENSITIES | used(), f"{page}: only tests call {code}"


def test_the_objects_that_travel_are_defined_where_the_page_says():
    (objects,) = [table for table in document("docs/architecture.md").tables() if "object" in table[0]]
    assert len(objects) >= 10
    for row in objects:
        (name,), (path,) = code_in(row["object"]), code_in(row["defined in"])
        assert name in defined_in(ROOT / path), f"{name} is not in {path}"


def rooms_in(table):
    return {code_in(row["room"])[0].rstrip("/"): row for row in table}


def test_the_rooms_of_core_and_their_arrows_are_those_of_the_imports():
    (table,) = [table for table in document("docs/architecture.md").tables() if "imports from" in table[0]]
    rooms = rooms_in(table)
    assert set(rooms) == {path.relative_to(ROOT).as_posix() for path in _folders("core")}
    for room, row in rooms.items():
        told, real = set(code_in(row["imports from"])), _imported_rooms(ROOT / room)
        assert told == real, f"{room} imports from {sorted(real)}"


def test_the_rooms_of_eval_are_on_the_page_in_the_order_of_their_imports():
    (table,) = [table for table in document("docs/architecture.md").tables() if set(table[0]) == {"room", "what is in it"}]
    rooms = [room.removeprefix("eval/") for room in rooms_in(table)]
    assert set(rooms) == {path.name for path in _folders("eval")}
    for place, room in enumerate(rooms):
        assert _imported_rooms(ROOT / "eval" / room) <= set(rooms[:place]), room


def _folders(part):
    return [path for path in (ROOT / part).iterdir() if path.is_dir() and list(path.rglob("*.py"))]


def _imported_rooms(folder):
    """Names of the other folders of the same part that a folder's modules import from."""
    part = folder.parent.name
    found = set()
    for path in folder.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        found |= {name.split(".")[0] for name in re.findall(rf"(?:from|import) hippodrome\.{part}\.([\w.]+)", text)}
        for names in re.findall(rf"from hippodrome\.{part} import ([\w, ]+)", text):
            found |= {name.split(" as ")[0].strip() for name in names.split(",")}
    return {name for name in found if (folder.parent / name).is_dir()} - {folder.name}


# --- keys of scenarios, figures of results, files that runs write


@DOCUMENTS
def test_every_key_of_a_scenario_exists_and_takes_the_value_shown(page, tmp_path):
    keys = {key.name for key in scenario_keys()} | {"noise." + name for name in _noise_figures()}
    parts = {key.partition(".")[0] for key in keys if "." in key}
    figures = {f"localization.{name}" for name in LocalizationSummary.model_fields}
    for code in page.inline:
        key, colon, value = code.partition(": ")
        if not re.fullmatch(r"\w+(\.[\w*]+)+", key) or key.split(".")[0] not in parts | {"localization"} or FILE.fullmatch(code):
            continue
        if key in figures:
            continue
        if key.endswith("*") and any(figure.startswith(key.rstrip("*")) for figure in figures):
            continue
        written = DRIVES.sub(r"mapping.\1", key)
        assert written in keys or any(known.startswith(f"{written}.") for known in keys), f"{page}: {code}"
        if colon:
            _load(tmp_path, key, value)


def _noise_figures():
    return {name for row in document("docs/scenarios.md").inline for name in re.findall(r"^noise\.(\w+)$", row)}


def _load(folder, key, value):
    """A scenario with this key, read by the real reader."""
    nested = yaml.safe_load(value)
    for part in reversed(key.split(".")):
        nested = {part: nested}
    path = folder / "one.yaml"
    path.write_text(yaml.safe_dump({"name": "one", **nested}))
    load_scenario(path)


@DOCUMENTS
def test_every_yaml_shown_is_a_scenario(page, tmp_path):
    shown = [text for language, text in page.fences if language == "yaml"]
    shown += [block for block in page.blocks if re.match(r"\w+:( \w+)?\n", block)]
    for text in shown:
        path = tmp_path / "shown.yaml"
        path.write_text(yaml.safe_dump({"name": "shown"} | yaml.safe_load(text)))
        load_scenario(path)


@DOCUMENTS
def test_every_file_named_is_in_the_repository_or_is_written_by_the_code(page):
    for code in page.inline:
        for word in code.split():
            name = word.rsplit("/", 1)[-1].replace("<method>-<number>", "METHOD").replace("METHOD-NUMBER", "METHOD")
            if not FILE.fullmatch(word) or word in OF_A_READER or name in OF_A_READER or PATH.match(word):
                continue
            assert (ROOT / word).exists() or _written(name), f"{page}: {word}"


def _written(name):
    """Whether the sources make a file of this name: its literal, or its parts around what stands for a name."""
    if any(name in text for text in sources().values()):
        return True
    pieces = [piece for piece in re.split(r"METHOD|NN|\*|<\w+>|(?<=-)(?=\w)|(?=\.)", name) if piece]
    return any(all(_stands_alone(piece, text) for piece in pieces) for text in sources().values())


def _stands_alone(piece, text):
    return re.search(rf"(?<!\w){re.escape(piece)}" + (r"(?!\w)" if piece[-1].isalnum() else ""), text)
