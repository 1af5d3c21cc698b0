"""Whatever text is written into a TOML file is read back."""

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from bowden.core.toml_text import quoted


@given(st.text())
def test_any_text_comes_back(text: str) -> None:
    assert tomllib.loads(f"a = {quoted(text)}") == {"a": text}
