# SPDX-License-Identifier: Apache-2.0
"""Options of a render: their names, C++'s defaults, and what checks another value."""

from __future__ import annotations

from typing import Any, Callable, Optional, Sequence

from tilegrad import _arrays, _core

_Reader = Callable[[str, str, Any], Any]


def _number(kind: type) -> _Reader:
    return lambda function, name, value: _arrays.as_number(function, name, value, kind)


def _choice(choices: Sequence[str]) -> _Reader:
    return lambda function, name, value: _arrays.check_choice(function, name, value, choices)


def _option(name: str, choices: Optional[Sequence[str]] = None) -> tuple[Any, _Reader]:
    """C++'s default of an option, and what checks another value."""
    value = getattr(_core.RenderOptions(), name)
    return (choices[value], _choice(choices)) if choices else (value, _number(type(value)))


# In the order in which Renderer.render has them.
_OPTIONS = {"width": _option("width"), "height": _option("height"), "delta": _option("delta"),
            "max_alpha_error": _option("max_alpha_error"),
            "interpolation": _option("interpolation", _core.INTERPOLATIONS),
            "culling": _option("culling", _core.CULLINGS),
            "alpha_rule": _option("alpha_rule", _core.ALPHA_RULES),
            "paper_box": _option("paper_box"), "paper_faces": _option("paper_faces")}
DEFAULTS = {name: default for name, (default, _) in _OPTIONS.items()}
# Those that functions hand on, beside the size of the image.
PASSED_ON = frozenset(_OPTIONS) - {"width", "height"}


def options_of(*values: Any) -> _core.RenderOptions:
    """Of a value for each option, which is checked if it is not the default itself."""
    options = _core.RenderOptions()
    for (name, (default, read)), value in zip(_OPTIONS.items(), values):
        if value is not default:
            setattr(options, name, read("render", name, value))
    return options
