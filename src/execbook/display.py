"""How numbers, figures and tables look in a notebook, with a record for the book."""

from __future__ import annotations

import base64
import html
import io
import math
import numbers
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tabulate import tabulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_TYPE = "application/vnd.execbook.figure+json"
TABLE_TYPE = "application/vnd.execbook.table+json"
NBSP = "\u00a0"  # between a number, its power of ten and its unit, so that no line break tears them
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float, digits: int = 4) -> str:
    """Give a number for readers, as in `−1.234` or `1.234 × 10⁻⁷`, with so many digits."""
    if isinstance(value, numbers.Integral):
        return str(value).replace("-", "−")
    if not math.isfinite(value):
        return {math.inf: "∞", -math.inf: "−∞"}.get(value, "not a number")
    if value == 0:
        return "0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    easy = -3 <= power < 6
    return (f"{value:.{max(digits - 1 - power, 0)}f}" if easy else mantissa + _power(power)).replace("-", "−")


def quantity(value: float, unit: str = "", digits: int = 4) -> str:
    """Give a number with its unit for readers, as in `1.234 × 10⁻⁷ m/s²`."""
    return number(value, digits) + (NBSP + unit_text(unit) if unit else "")


def unit_text(unit: str) -> str:
    """Give a unit as recorded, `m/s^2` or `us`, as readers know it, `m/s²` or `µs`."""
    micro = re.sub(r"\bu(?=(?:s|m|rad|as|Gal)\b)", "µ", unit)
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_SUPERSCRIPT), micro)


def _power(exponent: int) -> str:
    return f"{NBSP}×{NBSP}10{str(exponent).translate(_SUPERSCRIPT)}"


def cell(value: Any, form: str | None = None) -> str:
    """Give the text of a table's cell: a number by `form` or `number`, None as a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, numbers.Real):
        return str(value)
    value = value.item() if hasattr(value, "item") else value
    if not form or value == 0:
        return number(value)
    mantissa, e, exponent = f"{value:{form}}".partition("e")
    return mantissa.replace("-", "−") + (_power(int(exponent)) if e else "")


def as_png(figure: Figure, dpi: float) -> bytes:
    """Give a figure as an image, of the same figure always the same bytes, and close it."""
    import matplotlib.pyplot as plt

    if layout := figure.get_layout_engine():  # once: savefig would draw the whole figure twice for it
        figure.set_dpi(dpi)
        layout.execute(figure)
        figure.set_layout_engine("none")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def figure_bundle(record: Mapping[str, Any], png: bytes) -> dict[str, Any]:
    """Make the MIME bundle of a figure; `record` has name, caption, alt, width (px) and files."""
    text = (
        f'<figure>\n<img src="{inlined(png)}" alt="{html.escape(record["alt"])}" '
        f'width="{record["width"]}" style="max-width: 100%; height: auto">\n'
        f"<figcaption>{html.escape(record['caption'], quote=False)}</figcaption>\n</figure>"
    )
    plain = f"Figure {record['name']}: {record['caption']}"
    return {"text/html": text, "text/plain": plain, FIGURE_TYPE: dict(record)}


def inlined(png: bytes) -> str:
    """Give an image as the address that carries it."""
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"


def table_bundle(record: Mapping[str, Any]) -> dict[str, Any]:
    """Make the MIME bundle of a table of texts.

    record : name, caption, header, rows, align and files
    """
    parts, caption = (record["header"], record["rows"], record["align"]), record["caption"]
    text = f"<p>{html.escape(caption, quote=False)}</p>\n{table(*parts, form='html')}"
    return {"text/html": text, "text/plain": f"{caption}\n{table(*parts)}", TABLE_TYPE: dict(record)}


def table(
    header: Sequence[Any], rows: Sequence[Sequence[Any]], align: Sequence[str] | None = None, form: str = "simple"
) -> str:
    """Give a table as aligned text, or as `html`; `align` has left or right per column."""
    align = align or ["left"] * len(header)
    return tabulate(rows, header, form, colalign=align if rows else None, disable_numparse=True)


def markdown_table(header: Sequence[Any], rows: Sequence[Sequence[Any]], align: Sequence[str] | None = None) -> str:
    """Give a table as Markdown with pipes; `align` has left or right per column."""
    rule = ["---:" if a == "right" else ":---" for a in (align or ["left"] * len(header))]
    lines = [[line(text).replace("|", "\\|") for text in row] for row in (header, *rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in [lines[0], rule, *lines[1:]])


def line(text: object) -> str:
    """Give a text on one line; its no-break spaces stay."""
    return re.sub(r"[ \t\r\n]+", " ", str(text)).strip(" ")


def show(bundle: Mapping[str, Any]) -> None:
    """Display a bundle in a notebook, or print its text elsewhere."""
    from IPython import get_ipython
    from IPython.display import display

    if get_ipython() is None:
        print(bundle["text/plain"])
    else:
        display(dict(bundle), raw=True)
