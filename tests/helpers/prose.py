"""Sentences of the book's pages: how long they are, and which words they should not use.

``python tests/helpers/prose.py PAGE.md ...`` lists what to mend. Paragraphs, lists and captions count; tables, code,
formulas and directives do not. A formula, a link and a number count as one word each.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from mdit_py_plugins.front_matter import front_matter_plugin

LONGEST = 30
"""Words of a sentence."""

AVOID = {
    r"in order to": "to",
    r"utili[sz]\w*": "use",
    r"(?:note|notice) that": "the statement itself",
    r"it (?:is worth noting|should be (?:noted|mentioned)) that": "the statement itself",
    r"simply|obviously|of course|clearly,|needless to say|actually|basically": "nothing",
    r"behavior|center(?:s|ed|ing)?|(?:Number|\d) meters?|kilometers?|neighbor\w*|colors?|model(?:ed|ing)|label(?:ed|ing)": "British spelling",
    r"(?:line|anal|organ|normal|initial|optim|minim|maxim|recogn|summar)(?:i?z)(?:e[sd]?|ing|ation)": "British spelling",
    r"tells? (?:its|the) story|speaks? for itself|at the end of the day|by and large|last but not least": "a plain statement",
    r"bites?|strangers?": "a plain word",
}
"""Pattern -> what to write instead."""

_ABBREVIATED = re.compile(r"\b(e\.g|i\.e|cf|Fig|Figs|Eq|Eqs|Sect|No|et al|vs|approx|resp|St)\.\s")
_ROLE = re.compile(r"\{(\w[\w:-]*)\}(`+)(.+?)\2", re.DOTALL)
_POWER = re.compile(r"(?:\\cdot|\\times|[x×])\s*10\^\{?[01]\}?(?![\d}])")


class Sentence(NamedTuple):
    """One sentence: its text with formulas, links and numbers as words, and the line where its paragraph begins."""

    text: str
    line: int

    @property
    def words(self) -> int:
        """Count the words."""
        return sum(any(c.isalnum() for c in word) for word in self.text.split())


def plain(text: str) -> str:
    """Replace formulas, code, roles, links and recorded numbers by words."""
    text = _ROLE.sub(
        lambda role: re.sub(r"\s*<[^>]*>$", "", role[3]) if role[1] in {"term", "doc", "ref"} else "Ref", text
    )
    text = re.sub(r"\[\[[^\]]*\]\]", "Number", text)
    text = re.sub(r"\$\$.+?\$\$|\$.+?\$", "Formula", text, flags=re.DOTALL)
    text = re.sub(r"`+[^`]+`+", "Code", text)
    text = re.sub(r"<https?://[^>]*>|https?://\S+", "Link", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"<!--.*?-->|<[^>]+>|\*+|\{[^}]*\}", "", text, flags=re.DOTALL)


def split(text: str, line: int) -> list[Sentence]:
    """Split a paragraph into sentences."""
    text = _ABBREVIATED.sub(r"\1․ ", plain(text))  # a dot that ends no sentence
    parts = re.split(r"(?<=[.!?])[)\"”']?\s+(?=[\"“(\[]?[A-Z0-9])|\n\n", " ".join(text.split("\n")))
    return [Sentence(" ".join(part.split()), line) for part in parts if part and part.strip()]


def sentences(page: str) -> list[Sentence]:
    """Find the sentences of a page in MyST Markdown, those of its captions among them."""
    parser = MarkdownIt("commonmark").enable("table").use(front_matter_plugin)
    tokens, found, cell = parser.parse(page), [], 0
    for token in tokens:
        line = (token.map or [0])[0] + 1
        cell += {"table_open": 1, "table_close": -1, "heading_open": 1, "heading_close": -1}.get(token.type, 0)
        if token.type == "inline" and not cell:
            if not re.match(r"(:::|<!--|\(.*\)=$|:\w+:|\$\$)", token.content):
                found += split(re.sub(r"^: ", "", token.content), line)
        elif token.type == "fence" and token.info.startswith("{code-cell}"):
            found += _captions(token.content, line)
    return found


def _captions(code: str, line: int) -> list[Sentence]:
    try:
        tree = ast.parse(re.sub(r"^:.*$", "", code, flags=re.MULTILINE))
    except SyntaxError:
        return []
    return [
        sentence
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg == "caption"
        for part in ast.walk(node.value)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
        for sentence in split(part.value, line + part.lineno)
    ]


def faults(page: str) -> list[str]:
    """List what to mend on a page, each with its line."""
    found = []
    for sentence in sentences(page):
        if sentence.words > LONGEST:
            found.append(f"line {sentence.line}: {sentence.words} words: {sentence.text}")
        for pattern, better in AVOID.items():
            if hit := re.search(rf"\b(?:{pattern})\b", sentence.text, re.IGNORECASE):
                found.append(f"line {sentence.line}: {hit[0]!r}; write {better}: {sentence.text}")
    for number, line in enumerate(page.splitlines(), 1):
        if _POWER.search(line):
            found.append(f"line {number}: a number times 10^0 or 10^1: {line.strip()[:80]}")
    return found


def average(page: str) -> float:
    """Give the mean number of words of the sentences of a page, 0 for a page without any."""
    counts = [s.words for s in sentences(page) if s.words]
    return sum(counts) / len(counts) if counts else 0.0


if __name__ == "__main__":
    for name in sys.argv[1:]:
        text = Path(name).read_text(encoding="utf-8")
        print(f"{name}: {average(text):.1f} words a sentence")
        for fault in faults(text):
            print(f"  {fault}")
