"""The fields of a scenario by dotted name."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel


def fields_of(section: type[BaseModel] | BaseModel, prefix: str = "") -> dict[str, Any]:
    """Dotted name of every field below a section, with pydantic's description of it."""
    kind = section if isinstance(section, type) else type(section)
    found: dict[str, Any] = {}
    for name, field in kind.model_fields.items():
        value = field.default if isinstance(section, type) else getattr(section, name)
        if isinstance(value, BaseModel):
            found |= fields_of(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = field
    return found
