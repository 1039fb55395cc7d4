"""The parameters of a notebook: read from its tagged cell, explained, and checked with one clear sentence."""

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
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict

from geokalman.reproduce import notebooks, yamltext
from geokalman.reproduce.errors import Fault, Misuse, is_plain, shown

if TYPE_CHECKING:
    from nbformat import NotebookNode

Kind = Literal["float", "int", "str", "bool"]
_WORDS = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}
_NUMBER = r"[-+]?(?:inf|\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?)"
_INTERVAL = re.compile(rf"([\[(])\s*({_NUMBER})\s*,\s*({_NUMBER})\s*([\])])", re.I)
_CHOICES = re.compile(r"\{([^{}]*)\}")
_TYPE = re.compile(r"(list\[)?(float|int|str|bool)(?(1)\])(?=\s|$)")


class Interval(BaseModel):
    """An interval of numbers, each end open or closed."""

    model_config = ConfigDict(frozen=True)
    low: float
    high: float
    low_open: bool
    high_open: bool

    def __contains__(self, x: float) -> bool:
        above = x > self.low if self.low_open else x >= self.low
        return above and (x < self.high if self.high_open else x <= self.high)

    def __str__(self) -> str:
        return f"{'(' if self.low_open else '['}{self.low:.10g}, {self.high:.10g}{')' if self.high_open else ']'}"


class Parameter(BaseModel):
    """One parameter: type from the default; unit, range (interval or choices) and help from the comment."""

    model_config = ConfigDict(frozen=True)
    name: str
    kind: Kind
    many: bool = False
    optional: bool = False
    default: Any = None
    unit: str = ""
    interval: Interval | None = None
    choices: tuple[Any, ...] | None = None
    help: str = ""

    @property
    def type(self) -> str:
        """Name of the type, e.g. `float`, `list[int]`, `str or None`."""
        base = self.unit if self.is_path else self.kind
        return (f"list[{base}]" if self.many else base) + (" or None" if self.optional else "")

    @property
    def range(self) -> str:
        """The range as the comment has it, or nothing."""
        if self.choices is not None:
            return "{" + ", ".join(str(c) for c in self.choices) + "}"
        return str(self.interval) if self.interval else ""

    @property
    def is_path(self) -> bool:
        """Is it the path of a file (unit `path`) or of a folder (unit `folder`), relative to whoever gives it?"""
        return self.unit in ("path", "folder")

    @property
    def wanted(self) -> str:
        """What would be right, in a few words."""
        words = ("a list, each item " if self.many else "") + _WORDS[self.kind]
        if self.range:
            words += f" in {self.range}"
        if self.unit and not self.is_path:
            words += f" {self.unit}"
        return words + (" or None" if self.optional else "")

    def check(self, value: Any, base: Path | None = None) -> Any:
        """The value in the parameter's own type; raises Misuse for another type or one out of range.

        An int is taken for a float, never a bool for a number. A path is made absolute from `base` and must exist. An
        empty list is refused unless it is the default.
        """
        if value is None and self.optional:
            return None
        if self.many:
            if isinstance(value, str | bytes | Mapping) or not isinstance(value, Sequence):
                if not (hasattr(value, "tolist") and getattr(value, "ndim", 0) == 1):
                    raise self._wrong(value)
                value = value.tolist()
            if not value and self.default:
                raise Misuse(f"{self.name} = [] is empty; give at least one value.")
            return [self._item(item, base, f"[{k}]") for k, item in enumerate(value)]
        return self._item(value, base)

    def _item(self, value: Any, base: Path | None, place: str = "") -> Any:
        boolean = isinstance(value, bool) or type(value).__name__ in ("bool_", "bool")
        if self.kind == "bool" and boolean:
            return bool(value)
        if self.kind == "str" and isinstance(value, str):
            result: Any = self._file(value, base) if self.is_path and value else value
            if not is_plain(result):
                raise self._wrong(result, "not plain text (a control character, or bytes that are no UTF-8)", place)
        elif self.kind == "int" and isinstance(value, numbers.Integral) and not boolean:
            result = int(value)
        elif self.kind == "float" and isinstance(value, numbers.Real) and not boolean:
            try:
                result = float(value)
            except OverflowError:  # a whole number of more than 308 digits
                result = math.inf
            if not math.isfinite(result):
                raise self._wrong(value, "not finite", place)
        else:
            raise self._wrong(value, None, place)
        if self.choices is not None and result not in self.choices:
            raise self._wrong(value, "none of the choices", place)
        if self.interval is not None and result not in self.interval:
            raise self._wrong(value, "out of range", place)
        return result

    def _file(self, value: str, base: Path | None) -> str:
        folder = self.unit == "folder"
        path = Path(value)
        try:
            path = ((base or Path.cwd()) / path.expanduser()).resolve()
            if path.is_dir() if folder else path.is_file():
                return str(path)
            what = "is a folder" if path.is_dir() else "is a file" if path.is_file() else "is neither file nor folder"
            what = what if path.exists() else "does not exist"
        except (OSError, RuntimeError, ValueError) as error:  # a loop of links, ~ of an unknown user; a zero byte
            what = f"cannot be reached ({getattr(error, 'strerror', None) or error})"
        about = f" ({self.help})" if self.help else ""
        kind = "folder" if folder else "file"
        raise Misuse(
            f"{self.name}={shown(value)}: {shown(str(path))} {what}; "
            f"{self.name} must be the path of an existing {kind}{about}."
        )

    def _wrong(self, value: Any, why: str | None = None, place: str = "") -> Misuse:
        why = why or f"not {self.kind if place else self.type}"
        about = f" ({self.help})" if self.help else ""
        return Misuse(f"{self.name}{place}={_show(value)} is {why}; {self.name} must be {self.wanted}{about}.")


def _show(value: Any) -> str:
    return shown(repr(value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value), 60)


class Specification(BaseModel):
    """All parameters of one notebook, and the values of its quick mode."""

    model_config = ConfigDict(frozen=True)
    notebook: str
    parameters: dict[str, Parameter]
    quick: dict[str, Any]

    @property
    def defaults(self) -> dict[str, Any]:
        """The paper-scale values."""
        return {name: p.default for name, p in self.parameters.items()}

    def check(self, given: Mapping[str, Any], base: Path | None = None) -> dict[str, Any]:
        """The given values, checked; raises Misuse (with the valid names) for an unknown one or a wrong value."""
        for name in given:
            if name not in self.parameters:
                raise self.unknown(name)
        return {name: self.parameters[name].check(value, base) for name, value in given.items()}

    def unknown(self, name: str) -> Misuse:
        """The error for a name that is no parameter."""
        near = difflib.get_close_matches(name, self.parameters, n=1)
        hint = f" (did you mean {near[0]}?)" if near else ""
        valid = ", ".join(self.parameters) or "none"
        return Misuse(f"{shown(name)} is no parameter of {self.notebook}{hint}; the valid ones are {valid}.")

    def changed(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The values that differ from the paper-scale ones."""
        return {name: value for name, value in values.items() if value != self.defaults.get(name)}

    def mode(self, values: Mapping[str, Any]) -> str:
        """`paper` for the defaults, `quick` for the quick values, else `custom`."""
        for word, wanted in (("paper", self.defaults), ("quick", self.defaults | self.quick)):
            if dict(values) == wanted:
                return word
        return "custom"

    def parse(self, assignments: Sequence[str], base: Path | None = None) -> dict[str, Any]:
        """Values of command-line words `name=value` (YAML values), checked; raises Misuse for what is wrong in them."""
        given: dict[str, Any] = {}
        for word in assignments:
            name, equals, text = word.partition("=")
            name = name.strip()
            if not equals or not name:
                raise Misuse(f"{_show(word)} is no assignment; write name=value, as in days=5.")
            if name not in self.parameters:
                raise self.unknown(name)
            if name in given:
                raise Misuse(f"{name} is given twice ({shown(word)} is the second); give it once.")
            given[name] = _parse_value(text, self.parameters[name])
        return self.check(given, base)


def _parse_value(text: str, parameter: Parameter) -> Any:
    try:
        value = yamltext.parse(text)
    except ValueError as error:
        if parameter.kind == "str" and not parameter.many:
            return text
        why = str(error).removeprefix("line 1: ")
        raise Misuse(
            f"{parameter.name}={shown(text)} is no YAML value ({why}); {parameter.name} must be {parameter.wanted}."
        ) from error
    if parameter.kind == "str" and not parameter.many and not isinstance(value, str):
        return None if value is None and parameter.optional else text
    return value


def load(root: Path, name: str) -> Specification:
    """Specification of notebook `name` of the clone at `root`."""
    return specification(notebooks.read(root, name), name)


def specification(notebook: NotebookNode, name: str) -> Specification:
    """Read the cells tagged `parameters` and `quick`; raises Fault with notebook and line for malformed ones."""
    try:
        source, quick_source = notebooks.tagged(notebook, "parameters"), notebooks.tagged(notebook, "quick")
        parameters = {p.name: p for p in _read_cell(source)} if source else {}
        spec = Specification(notebook=name, parameters=parameters, quick={})
        return spec.model_copy(update={"quick": spec.check(_read_quick(quick_source))}) if quick_source else spec
    except Fault as error:
        raise Fault(f"{name}: {error}") from error


def _literal(node: ast.expr, text: str) -> Any:
    try:
        return ast.literal_eval(node)
    except ValueError as error:
        raise Fault(f"{text!r} is no literal; a parameter's default is one.") from error


def _read_quick(source: str) -> dict[str, Any]:
    tree = ast.parse(source)
    assigned = [n for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "quick"]
    if len(tree.body) != 1 or not assigned:
        raise Fault('the cell tagged quick must be one assignment, as in quick = {"days": 5.0}.')
    values = _literal(assigned[0].value, source)
    if not isinstance(values, dict):
        raise Fault(f"quick = {values!r} is no dictionary of parameter values.")
    return values


def _read_cell(source: str) -> list[Parameter]:
    comments = {}
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            comments[token.start[0]] = token.string.lstrip("# ").strip()
    found = []
    for node in ast.parse(source).body:
        line = ast.unparse(node)
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
        else:
            raise Fault(
                f"line {node.lineno} of the parameters cell, {line!r}, is no assignment of a literal to a name."
            )
        try:
            comment = comments.get(node.end_lineno or node.lineno, "")
            found.append(_describe(name, _literal(node.value, ast.unparse(node.value)), comment))
        except Fault as error:
            raise Fault(f"line {node.lineno} of the parameters cell: {error}") from error
    return found


def _describe(name: str, default: Any, comment: str) -> Parameter:
    """Parameter from default and comment `<range> <unit>: <help>`; a None default's unit begins with its type."""
    bounds = _INTERVAL.match(comment)
    braces = _CHOICES.match(comment)
    rest = comment[(bounds or braces).end() :] if bounds or braces else comment  # type: ignore[union-attr]
    unit, colon, text = rest.partition(":")
    if not colon:
        unit, text = ("", rest) if not (bounds or braces) else (rest, "")
    unit = unit.strip()
    named = _TYPE.match(unit)
    if named:
        unit = unit[named.end() :].strip()
        kind, many = named[2], bool(named[1])
    else:
        kind, many = _kind_of(name, default)
    choices = tuple(_choice(c.strip(), kind) for c in braces[1].split(",")) if braces else None
    interval = None
    if bounds:
        low, high = float(bounds[2]), float(bounds[3])
        interval = Interval(low=low, high=high, low_open=bounds[1] == "(", high_open=bounds[4] == ")")
    parameter = Parameter(
        name=name, kind=kind, many=many, optional=default is None, unit=unit, interval=interval, choices=choices,
        help=text.strip(),
    )  # fmt: skip
    default = list(default) if isinstance(default, tuple) else default
    return parameter.model_copy(update={"default": parameter.check(default)})


def _choice(text: str, kind: str) -> Any:
    try:
        return {"float": float, "int": int, "str": str, "bool": lambda t: t == "True"}[kind](text.strip("\"'"))
    except ValueError as error:
        raise Fault(f"the choice {text!r} is not {_WORDS[kind]}.") from error


def _kind_of(name: str, default: Any) -> tuple[str, bool]:
    many = isinstance(default, list | tuple)
    kinds = {type(item).__name__ for item in (default if many else [default])}
    if kinds == {"int", "float"}:
        kinds = {"float"}
    if len(kinds) != 1 or not kinds <= set(_WORDS):
        raise Fault(
            f"{name} = {default!r} has no clear type; "
            "name it in the comment (# str: ..., # list[float] m: ...) or give a number, text, bool or list of them."
        )
    return kinds.pop(), many
