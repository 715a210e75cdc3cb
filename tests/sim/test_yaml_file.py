"""A scenario's errors name the file, the line, the key and the reason."""

import pytest
from pydantic import Field

from hippodrome.sim.spec import Spec
from hippodrome.sim.yaml_file import ScenarioError, load_yaml


class Inner(Spec):
    size: int = Field(1, le=10)


class Outer(Spec):
    name: str
    inner: Inner = Inner()
    many: tuple[Inner, ...] = ()


def load(tmp_path, text):
    path = tmp_path / "a.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_yaml(path, Outer)


def test_defaults_are_overridden_only_where_the_file_speaks(tmp_path):
    assert load(tmp_path, "name: x\ninner: {size: 3}\n") == Outer(name="x", inner=Inner(size=3))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: x\ninner:\n  sise: 3\n", "a.yaml:3: inner.sise: unknown key"),
        ("name: x\ninner:\n  size: 11\n", "a.yaml:3: inner.size: must be a number of at most 10, not 11"),
        ("name: x\nmany:\n - {size: 1}\n - {size: big}\n", "a.yaml:4: many.1.size: must be a whole number, not 'big'"),
        ("inner: {}\n", "a.yaml:1: name: must be given"),
        ("name: [x\n", "a.yaml:2: not valid YAML"),
        ("- 1\n", "a.yaml: a scenario is a mapping"),
        ("", "a.yaml: a scenario is a mapping"),
        ("name: !!python/object/apply:os.system [ls]\n", "a.yaml:1: not valid YAML"),
        (b"\xff\xfe\x00", "not"),
        ("[" * 100_000, "a.yaml"),
    ],
)
def test_errors_name_the_place(tmp_path, text, expected):
    with pytest.raises(ScenarioError) as error:
        load(tmp_path, text)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_and_a_huge_file_are_refused(tmp_path):
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_yaml(tmp_path / "none.yaml", Outer)
    (tmp_path / "huge.yaml").write_bytes(b"#" * (2 << 20))
    with pytest.raises(ScenarioError, match="at most 1 MiB"):
        load_yaml(tmp_path / "huge.yaml", Outer)


def test_a_name_that_no_file_can_have_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"a.yaml:2: a zero byte"):
        load(tmp_path, 'inner: {size: 3}\nname: "a\\0b"\n')
