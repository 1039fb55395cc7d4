"""How a figure or table of a notebook looks as output: HTML with nothing remote, and a JSON record for the book."""

from __future__ import annotations

import base64
import html
import math
import numbers
import re
from collections.abc import Mapping, Sequence
from typing import Any

FIGURE_TYPE = "application/vnd.geokalman.figure+json"
TABLE_TYPE = "application/vnd.geokalman.table+json"
_NBSP = "\u00a0"  # between a number, its power of ten and its unit, so that no line break tears them
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float, digits: int = 4) -> str:
    """A number for readers: `digits` significant ones, `1.234 × 10⁻⁷` beyond the easy range, a true minus sign."""
    if isinstance(value, numbers.Integral):
        return str(value).replace("-", "−")
    if not math.isfinite(value):
        return {math.inf: "∞", -math.inf: "−∞"}.get(value, "not a number")
    if value == 0:
        return "0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if -3 <= power < 6:
        text = f"{value:.{max(digits - 1 - power, 0)}f}"
    else:
        text = mantissa + _power(power)
    return text.replace("-", "−")


def quantity(value: float, unit: str = "", digits: int = 4) -> str:
    """A number with its unit for readers: powers raised, micro as µ, `1.234 × 10⁻⁷ m/s²`."""
    return number(value, digits) + (_NBSP + unit_text(unit) if unit else "")


def unit_text(unit: str) -> str:
    """A unit as recorded, `m/s^2` or `us`, as readers know it, `m/s²` or `µs`."""
    micro = re.sub(r"\bu(?=(?:s|m|rad|as|Gal)\b)", "µ", unit)
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_SUPERSCRIPT), micro)


def _power(exponent: int) -> str:
    return f"{_NBSP}×{_NBSP}10{str(exponent).translate(_SUPERSCRIPT)}"


def cell(value: Any, form: str | None = None) -> str:
    """Text of a table's cell: a number by `form` (a format specification) or by `number`, None as a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, numbers.Real):
        value = value.item() if hasattr(value, "item") else value
        if not form or value == 0:
            return number(value)
        mantissa, e, exponent = f"{value:{form}}".partition("e")
        return mantissa.replace("-", "−") + (_power(int(exponent)) if e else "")
    return str(value)


def figure_bundle(record: Mapping[str, Any], png: bytes) -> dict[str, Any]:
    """MIME bundle of a figure; `record` has name, caption, alt, width (px) and files."""
    image = base64.b64encode(png).decode()
    text = (
        f'<figure style="margin: 1em 0">\n<img src="data:image/png;base64,{image}" alt="{html.escape(record["alt"])}" '
        f'width="{record["width"]}" style="max-width: 100%; height: auto">\n'
        f"<figcaption>{html.escape(record['caption'], quote=False)}</figcaption>\n</figure>"
    )
    return {
        "text/html": text,
        "text/plain": f"Figure {record['name']}: {record['caption']}",
        FIGURE_TYPE: dict(record),
    }


def table_bundle(record: Mapping[str, Any]) -> dict[str, Any]:
    """MIME bundle of a table; `record` has name, caption, header, rows (texts), align (per column) and files."""
    header, rows, align = record["header"], record["rows"], record["align"]
    head = "".join(
        f'<th scope="col" style="text-align: {a}">{html.escape(h)}</th>' for h, a in zip(header, align, strict=True)
    )
    body = []
    for row in rows:
        cells = [f'<th scope="row" style="text-align: {align[0]}">{html.escape(row[0])}</th>']
        cells += [f'<td style="text-align: {a}">{html.escape(t)}</td>' for t, a in zip(row[1:], align[1:], strict=True)]
        body.append(f"<tr>{''.join(cells)}</tr>")
    text = (
        f"<table>\n<caption>{html.escape(record['caption'], quote=False)}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{chr(10).join(body)}\n</tbody>\n</table>"
    )
    return {"text/html": text, "text/plain": plain_table(header, rows, record["caption"]), TABLE_TYPE: dict(record)}


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], align: Sequence[str] | None = None) -> str:
    """A table as Markdown with pipes; `align` gives left or right per column."""
    rule = ["---:" if a == "right" else ":---" for a in (align or ["left"] * len(header))]
    escaped = ([str(text).replace("|", "\\|").replace("\n", " ") for text in row] for row in [header, *rows])
    lines = ["| " + " | ".join(row) + " |" for row in escaped]
    lines.insert(1, "| " + " | ".join(rule) + " |")
    return "\n".join(lines)


def plain_table(header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """A table as aligned text."""
    lines = [list(header), *(list(row) for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    text = ["  ".join(t.ljust(w) for t, w in zip(line, widths, strict=True)).rstrip() for line in lines]
    text.insert(1, "  ".join("-" * w for w in widths))
    return "\n".join(([caption] if caption else []) + text)


def show(bundle: Mapping[str, Any]) -> None:
    """Display a bundle in a notebook, or print its text elsewhere."""
    try:
        from IPython import get_ipython
        from IPython.display import display
    except ImportError:
        get_ipython = None
    if get_ipython is None or get_ipython() is None:
        print(bundle["text/plain"])
    else:
        display(dict(bundle), raw=True)
