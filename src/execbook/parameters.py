"""The parameters of a notebook: read from its tagged cells, checked in one clear sentence."""

from __future__ import annotations

import ast
import difflib
import math
import numbers
import re
import tokenize
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from execbook import notebooks, yamltext
from execbook.errors import Fault, Misuse, is_plain, shown

if TYPE_CHECKING:
    from nbformat import NotebookNode

_WORDS = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}
_NUMBER = r"[-+]?(?:inf|\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?)"
_RANGE = re.compile(rf"(?:([\[(])\s*({_NUMBER})\s*,\s*({_NUMBER})\s*([\])])|\{{([^{{}}]*)\}})", re.I)
_TYPE = re.compile(r"(list\[)?(float|int|str|bool)(?(1)\])(?=\s|$)")


class Interval(NamedTuple):
    """An interval of numbers, each end open or closed."""

    opening: str
    low: float
    high: float
    closing: str

    def holds(self, x: float) -> bool:
        """Tell whether a number lies in it."""
        above = x > self.low if self.opening == "(" else x >= self.low
        return above and (x < self.high if self.closing == ")" else x <= self.high)

    def __str__(self) -> str:
        return f"{self.opening}{self.low:.10g}, {self.high:.10g}{self.closing}"


class Parameter(NamedTuple):
    """One parameter: type from the default; unit, range and help from the comment."""

    name: str
    kind: str
    many: bool = False
    optional: bool = False
    default: Any = None
    unit: str = ""
    interval: Interval | None = None
    choices: tuple[Any, ...] | None = None
    help: str = ""

    @property
    def type(self) -> str:
        """Name the type, as in `float`, `list[int]`, `str or None`."""
        base = self.unit if self.is_path else self.kind
        return (f"list[{base}]" if self.many else base) + (" or None" if self.optional else "")

    @property
    def range(self) -> str:
        """Give the range as the comment has it, or nothing."""
        if self.choices is not None:
            return "{" + ", ".join(map(str, self.choices)) + "}"
        return str(self.interval or "")

    @property
    def is_path(self) -> bool:
        """Tell whether it is the path of a file (unit `path`) or of a folder (unit `folder`)."""
        return self.unit in ("path", "folder")

    @property
    def wanted(self) -> str:
        """Say in a few words what would be right."""
        unit = "" if self.is_path else self.unit
        words = [_WORDS[self.kind], f"in {self.range}" if self.range else "", unit, "or None" if self.optional else ""]
        return ("a list, each item " if self.many else "") + " ".join(filter(None, words))

    def check(self, value: Any, base: Path | None = None) -> Any:
        """Give the value in the parameter's own type; raises Misuse for one that does not fit.

        An int is taken for a float, but a bool is no number. A path is made absolute from `base` and must exist. An
        empty list is refused unless it is the default.
        """
        if value is None and self.optional:
            return None
        if not self.many:
            return self._item(value, base)
        value = value.tolist() if getattr(value, "ndim", 0) == 1 else value
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Sequence):
            raise self._wrong(value)
        if not value and self.default:
            raise Misuse(f"{self.name} = [] is empty; give at least one value.")
        return [self._item(item, base, f"[{k}]") for k, item in enumerate(value)]

    def _item(self, value: Any, base: Path | None, place: str = "") -> Any:
        value = value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value
        boolean = isinstance(value, bool)
        if self.kind == "bool" and boolean:
            return value
        if self.kind == "str" and isinstance(value, str):
            result: Any = self._file(value, base) if self.is_path and value else value
            if not is_plain(result):
                raise self._wrong(result, "not plain text (a control character, or bytes that are no UTF-8)", place)
        elif self.kind == "int" and isinstance(value, numbers.Integral) and not boolean:
            result = int(value)
        elif self.kind == "float" and isinstance(value, numbers.Real) and not boolean:
            result = float(value) if abs(value) < 1e308 else math.inf  # a long whole number is too large for a float
            if not math.isfinite(result):
                raise self._wrong(value, "not finite", place)
        else:
            raise self._wrong(value, None, place)
        if self.choices is not None and result not in self.choices:
            raise self._wrong(value, "none of the choices", place)
        if self.interval is not None and not self.interval.holds(result):
            raise self._wrong(value, "out of range", place)
        return result

    def _file(self, value: str, base: Path | None) -> str:
        kind = "folder" if self.unit == "folder" else "file"
        path = Path(value)
        try:
            path = ((base or Path.cwd()) / path.expanduser()).resolve()
            found = "folder" if path.is_dir() else "file" if path.is_file() else ""
            if found == kind:
                return str(path)
            other = "is neither file nor folder" if path.exists() else "does not exist"
            what = f"is a {found}" if found else other
        except (OSError, RuntimeError, ValueError) as error:  # a loop of links, ~ of an unknown user; a zero byte
            what = f"cannot be reached ({getattr(error, 'strerror', None) or error})"
        raise Misuse(
            f"{self.name}={shown(value)}: {shown(str(path))} {what}; "
            f"{self.name} must be the path of an existing {kind}{self._about}."
        )

    @property
    def _about(self) -> str:
        return f" ({self.help})" if self.help else ""

    def _wrong(self, value: Any, why: str | None = None, place: str = "") -> Misuse:
        why = why or f"not {self.kind if place else self.type}"
        return Misuse(
            f"{self.name}{place}={shown(repr(value), 60)} is {why}; {self.name} must be {self.wanted}{self._about}."
        )


class Specification(NamedTuple):
    """All parameters of one notebook, and the values of its quick mode."""

    notebook: str
    parameters: dict[str, Parameter]
    quick: dict[str, Any]

    @property
    def defaults(self) -> dict[str, Any]:
        """Give the values at the paper's scale."""
        return {name: p.default for name, p in self.parameters.items()}

    def check(self, given: Mapping[str, Any], base: Path | None = None) -> dict[str, Any]:
        """Give the values, checked; raises Misuse for an unknown name or a wrong value."""
        return {name: self.known(name).check(value, base) for name, value in given.items()}

    def known(self, name: str) -> Parameter:
        """Give the parameter of this name; raises Misuse where there is none."""
        if name in self.parameters:
            return self.parameters[name]
        near = difflib.get_close_matches(name, self.parameters, n=1)
        hint = f" (did you mean {near[0]}?)" if near else ""
        valid = ", ".join(self.parameters) or "none"
        raise Misuse(f"{shown(name)} is no parameter of {self.notebook}{hint}; the valid ones are {valid}.")

    def changed(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Give the values that differ from those at the paper's scale."""
        return {name: value for name, value in values.items() if value != self.defaults.get(name)}

    def mode(self, values: Mapping[str, Any]) -> str:
        """Name the scale: `paper` for the defaults, `quick` for the quick values, else `custom`."""
        if not self.changed(values):
            return "paper"
        return "quick" if dict(values) == self.defaults | self.quick else "custom"

    def parse(self, assignments: Sequence[str], base: Path | None = None) -> dict[str, Any]:
        """Read words `name=value` (YAML values) of a command line; raises Misuse for wrong ones."""
        given: dict[str, Any] = {}
        for word in assignments:
            name, equals, text = word.partition("=")
            name = name.strip()
            if not equals or not name:
                raise Misuse(f"{shown(repr(word), 60)} is no assignment; write name=value, as in days=5.")
            if name in given:
                raise Misuse(f"{name} is given twice ({shown(word)} is the second); give it once.")
            given[name] = _parse_value(text, self.known(name))
        return self.check(given, base)


def _parse_value(text: str, parameter: Parameter) -> Any:
    is_text = parameter.kind == "str" and not parameter.many
    try:
        value = yamltext.parse(text)
    except ValueError as error:
        if is_text:
            return text
        why = str(error).removeprefix("line 1: ")
        name = parameter.name
        raise Misuse(f"{name}={shown(text)} is not a YAML value ({why}); {name} must be {parameter.wanted}.") from error
    if parameter.optional and (value is None or value == "None"):
        return None
    return text if is_text and not isinstance(value, str) else value


def load(root: Path, name: str) -> Specification:
    """Read the specification of notebook `name`."""
    return specification(notebooks.read(root, name), name)


def specification(notebook: NotebookNode, name: str) -> Specification:
    """Read the cells tagged `parameters` and `quick`; raises Fault for malformed ones."""
    try:
        source, quick = notebooks.tagged(notebook, "parameters"), notebooks.tagged(notebook, "quick")
        spec = Specification(name, {p.name: p for p in _read_cell(source or "")}, {})
        return spec._replace(quick=spec.check(_read_quick(quick))) if quick else spec
    except Fault as error:
        raise Fault(f"{name}: {error}") from error


def _literal(node: ast.expr) -> Any:
    try:
        return ast.literal_eval(node)
    except ValueError as error:
        raise Fault(f"{ast.unparse(node)!r} is no literal; a parameter's default is one.") from error


def _read_quick(source: str) -> dict[str, Any]:
    tree = ast.parse(source)
    assigned = [n for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "quick"]
    if len(tree.body) != 1 or not assigned:
        raise Fault('the cell tagged quick must be one assignment, as in quick = {"days": 5.0}.')
    values = _literal(assigned[0].value)
    if not isinstance(values, dict):
        raise Fault(f"quick = {values!r} is no dictionary of parameter values.")
    return values


def _read_cell(source: str) -> list[Parameter]:
    tokens = tokenize.generate_tokens(StringIO(source).readline)
    comments = {t.start[0]: t.string.lstrip("# ").strip() for t in tokens if t.type == tokenize.COMMENT}
    found = []
    for node in ast.parse(source).body:
        place = f"line {node.lineno} of the parameters cell"
        if not (isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name)):
            raise Fault(f"{place}, {ast.unparse(node)!r}, is no assignment of a literal to a name.")
        try:
            comment = comments.get(node.end_lineno or node.lineno, "")
            found.append(_describe(node.targets[0].id, _literal(node.value), comment))
        except Fault as error:
            raise Fault(f"{place}: {error}") from error
    return found


def _describe(name: str, default: Any, comment: str) -> Parameter:
    """Make a parameter of its default and comment `<range> <type> <unit>: <help>`."""
    ranged = _RANGE.match(comment)
    unit, colon, text = comment[ranged.end() if ranged else 0 :].partition(":")
    if not colon:
        unit, text = (unit, "") if ranged else ("", unit)
    unit = unit.strip()
    if named := _TYPE.match(unit):
        unit = unit[named.end() :].strip()
        kind, many = named[2], bool(named[1])
    else:
        kind, many = _kind_of(name, default)
    interval = choices = None
    if ranged and ranged[5] is None:
        interval = Interval(ranged[1], float(ranged[2]), float(ranged[3]), ranged[4])
    elif ranged:
        choices = tuple(_choice(word.strip(), kind) for word in ranged[5].split(","))
    parameter = Parameter(name, kind, many, default is None, None, unit, interval, choices, text.strip())
    return parameter._replace(default=parameter.check(default))


def _choice(text: str, kind: str) -> Any:
    try:
        return {"float": float, "int": int, "str": str, "bool": "True".__eq__}[kind](text.strip("\"'"))
    except ValueError as error:
        raise Fault(f"the choice {text!r} is not {_WORDS[kind]}.") from error


def _kind_of(name: str, default: Any) -> tuple[str, bool]:
    many = isinstance(default, list | tuple)
    kinds = {type(item).__name__ for item in (default if many else [default])}
    kinds = {"float"} if kinds == {"int", "float"} else kinds
    if len(kinds) != 1 or not kinds <= set(_WORDS):
        raise Fault(
            f"{name} = {default!r} has no clear type; "
            "name it in the comment (# str: ..., # list[float] m: ...) or give a number, text, bool or list of them."
        )
    return kinds.pop(), many
