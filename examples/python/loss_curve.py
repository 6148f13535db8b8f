# SPDX-License-Identifier: Apache-2.0
"""Loss curves as SVG, for the examples: no plotting library needed."""

from __future__ import annotations

import html
import math
from typing import Sequence

_WIDTH, _HEIGHT = 720, 360
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 24, 44, 46
_COLORS = ("#1f6fb4", "#d1602b", "#3a8f4d", "#7a5ba6")


def loss_curve_svg(title: str, x_label: str, curves: dict[str, Sequence[float]]) -> str:
    """Curves over 0, 1, 2, ..., the vertical axis logarithmic. curves: name -> numbers > 0."""
    low = math.floor(math.log10(min(min(c) for c in curves.values())))
    high = math.ceil(math.log10(max(max(c) for c in curves.values())))
    last = max(len(c) for c in curves.values()) - 1

    def x_of(step: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * step / max(last, 1)

    def y_of(value: float) -> float:
        share = (math.log10(value) - low) / max(high - low, 1)
        return _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * share

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{_HEIGHT}" '
             f'viewBox="0 0 {_WIDTH} {_HEIGHT}" font-family="sans-serif" font-size="13">'
             f'<rect width="100%" height="100%" fill="#fff"/>',
             _text(_LEFT, 20, title, "start", 'font-weight="bold"')]
    for power in range(low, high + 1):
        y = y_of(10.0**power)
        parts += [_line(_LEFT, y, _WIDTH - _RIGHT, y),
                  _text(_LEFT - 8, y + 4, f"{10.0**power:g}", "end")]
    for step in _ticks(last):
        parts += [_line(x_of(step), _TOP, x_of(step), _HEIGHT - _BOTTOM),
                  _text(x_of(step), _HEIGHT - _BOTTOM + 18, str(step), "middle")]
    parts.append(_text((_LEFT + _WIDTH - _RIGHT) / 2, _HEIGHT - 8, x_label, "middle"))
    for i, (name, values) in enumerate(curves.items()):
        color = _COLORS[i % len(_COLORS)]
        points = " ".join(f"{x_of(s):.1f},{y_of(v):.1f}" for s, v in enumerate(values))
        parts += [f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.6"/>',
                  _text(_LEFT + 8 + 150 * i, 36, name, "start", f'fill="{color}"')]
    return "\n".join([*parts, "</svg>", ""])


def _ticks(last: int) -> range:
    """About six of them, at 1, 2 or 5 times a power of ten."""
    rough = max(last / 6, 1)
    power = 10 ** math.floor(math.log10(rough))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= rough)
    return range(0, last + 1, step)


def _line(x0: float, y0: float, x1: float, y1: float) -> str:
    return f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="#ddd"/>'


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{html.escape(text)}</text>'
