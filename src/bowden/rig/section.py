"""What every section of rig.toml is made of."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


def key(default: Any, meaning: str, unit: str = "–", symbol: str = "", **rules: Any) -> Any:
    """A key with its default, its meaning, its unit, the paper's symbol, and the rules of its value."""
    return Field(default, description=meaning, json_schema_extra={"unit": unit, "symbol": symbol}, **rules)


class Section(BaseModel):
    """A table of rig.toml: unknown keys, numbers in quotation marks, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True, frozen=True)
