"""Tables of a page of documentation that are made from the code, between markers."""

from collections.abc import Mapping


def with_tables(page: str, tables: Mapping[str, str]) -> str:
    """The page with what stands between the markers of each name made anew."""
    for name, table in tables.items():
        begin, end = f"<!-- {name}: made by make docs -->\n", f"<!-- end of {name} -->"
        head, _, rest = page.partition(begin)
        _, _, tail = rest.partition(end)
        page = f"{head}{begin}{table}\n{end}{tail}"
    return page
