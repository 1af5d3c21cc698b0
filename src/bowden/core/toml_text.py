"""Text in TOML files that this package writes."""

import json


def quoted(text: str) -> str:
    """`text` as a basic string of TOML, which is one of JSON but for a sign.

    >>> print(quoted('a "b"'))
    "a \\"b\\""
    """
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
