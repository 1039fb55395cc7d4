"""YAML 1.2 as people type it: `1e-12` is a number, `no` and `12:30` are text."""

from __future__ import annotations

import re
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

_MAY_MARK = re.compile(r"(?:^|[\s,:?\[\]{}-])(?:[&*]\S|!)")  # an anchor, alias or tag; or a text that looks like one


def parse(text: str) -> Any:
    """Give the value of a YAML text; raises ValueError, with the place, for what is wrong.

    A key given twice is refused, and so are anchors, aliases, tags and deep nesting: a few bytes can fill the memory.
    """
    try:
        for event in YAML(typ="safe", pure=True).parse(text) if _MAY_MARK.search(text) else ():
            if getattr(event, "anchor", None) or getattr(event, "ctag", None):
                raise ValueError(f"line {event.start_mark.line + 1}: anchors, aliases and tags are not read")
        return YAML(typ="safe", pure=True).load(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}: " if mark else ""
        problem = getattr(error, "problem", None) or str(error)
        raise ValueError(place + " ".join(problem.split())) from error
