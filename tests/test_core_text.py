"""What is read from and written into files of others: TOML, texts of fields, copies of a user's file, messages."""

import ast
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.arguments import number
from bowden.core.errors import OutputError, ParameterError
from bowden.core.files import shortened, whole_files
from bowden.core.quantity import texts_of
from bowden.core.toml_text import quoted, with_keys
from bowden.core.user_file import UserModule, restored

KEYS = st.sampled_from(["a", "b", "c"])
TREES = st.dictionaries(st.sampled_from(["one", "two", "one.sub"]), st.dictionaries(KEYS, st.integers(0, 9)))


@given(st.text())
def test_any_text_comes_back(text: str) -> None:
    assert tomllib.loads(f"a = {quoted(text)}") == {"a": text}


@given(TREES, st.sampled_from(["one", "two", "one.sub", "new"]), st.dictionaries(KEYS, st.integers(10, 19), min_size=1))
def test_keys_are_changed_in_one_section_and_all_else_stands(
    tree: dict[str, dict[str, int]], section: str, values: dict[str, int]
) -> None:
    sections = [f"[{name}]  # why\n" + "".join(f"{k} = {v}\n" for k, v in rows.items()) for name, rows in tree.items()]
    written = with_keys("\n".join(sections), section, {k: str(v) for k, v in values.items()}, "x.toml")
    expected = tree | {section: tree.get(section, {}) | values}
    found = tomllib.loads(written)
    for name, rows in expected.items():
        part = found
        for word in name.split("."):
            part = part[word]
        assert {k: v for k, v in part.items() if not isinstance(v, dict)} == rows
    assert written.count("# why") == len(tree)
    assert written.startswith("\n") is False


@given(st.text(), st.integers(1, 20))
def test_a_text_for_a_message_is_as_long_as_it_may_be(text: str, most: int) -> None:
    found = shortened(text, most)
    assert found == text if len(text) <= most else (found[:-1] == text[: most - 1] and found[-1] == "…")
    assert len(found) == min(len(text), most)


@pytest.mark.parametrize("value", ["1.0", b"1.0", True, None, [1.0]])
def test_a_number_is_no_text_and_no_flag(value: object) -> None:
    with pytest.raises(ParameterError, match="so is"):
        number(value, "so")


def test_the_text_of_a_name_stands_behind_or_below_its_value() -> None:
    source = 'a = (\n    1\n)  # first\nb = 2\n"""second"""\nc = 3  # third\n4\nd = e = 5  # both\nprint()  # none'
    expected = {"a": "first", "b": "second", "c": "third", "d": "both", "e": "both"}
    assert texts_of(ast.parse(source).body, source) == expected


def test_a_users_file_is_restored_where_it_stands_or_as_a_copy_with_its_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bowden.core.user_file.cache_folder", lambda: tmp_path / "cache")
    path, modules = tmp_path / "own.py", (UserModule("parts/part.py", b"x = 1"),)
    for _ in range(2):
        copied = restored(path, b"import parts", "laws", modules)
        assert copied.path != path
        assert copied.path.read_bytes() == b"import parts"
        assert (copied.path.parent / "parts/part.py").read_bytes() == b"x = 1"
        copied.path.write_bytes(b"edited")  # and is mended
    path.write_bytes(b"import parts")
    assert restored(path, b"import parts", "laws", modules).path != path, "one of its modules is missing"
    assert restored(path, b"import parts", "laws").path == path
    assert restored(path, b"other", "laws").path != path


def test_why_a_folder_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder, said in ((tmp_path / "file" / "in", "File exists"), (tmp_path / "a\0b", "null")):
        with pytest.raises(OutputError, match=f"cannot make the folder .*{said}"), whole_files(folder):
            pass
