"""Text in TOML files that this package writes."""

import json


def quoted(text: str) -> str:
    """`text` as a basic string of TOML, which is one of JSON but for a sign.

    >>> print(quoted('a "b"'))
    "a \\"b\\""
    """
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def key_of(name: str) -> str:
    """A key of a section: in quotation marks where it has a dot, which would make a section of it.

    >>> print(key_of("gain"), key_of("part.gain"))
    gain "part.gain"
    """
    return quoted(name) if "." in name else name
