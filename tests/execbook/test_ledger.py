"""The ledger: what an entry must say, and the rule that it keeps to."""

import json

import pytest
from ledgerentries import BASE, make
from pydantic import ValidationError

from execbook import claims, ledger
from execbook.errors import Fault, Misuse


@pytest.mark.parametrize(
    "left, right, names",
    [
        ("a/01:rms.ekf.std", "a/01:rms.ukf.std", ("ekf", "ukf")),
        ("a/01:camera.1.rms", "a/01:camera.2.rms", ("camera 1 rms", "camera 2 rms")),
        ("a/01:x", "a/02:x", ("01", "02")),
        ("a/01:fused.std", "a/01:table.ukf.std", ("fused", "table ukf")),
    ],
)
def test_names_of_a_comparison_are_what_differs(left, right, names):
    assert ledger._names(left, right) == names


@pytest.mark.parametrize(
    "change, sentence",
    [
        ("source: null", "source: Input should be a valid string"),
        ("says: x\n  tells: y", "c: tells: Extra inputs"),
        ("accept: {rel: 0.1, abs: 1}", "accept: accept wants exactly one of"),
        ("accept: {range: [2, 1]}", "the range .* is empty"),
        ("accept: {factor: 0.5}", "accept.factor: Input should be greater"),
        ("accept: null", "a metric needs accept"),
        ("metric: null", "accept needs a metric"),
        ("metric: line", "metric: String should match pattern"),
        ("printed: about two", "accept needs a printed .or reads. number"),
        ("reads: 3.0", "reads and because go together"),
        ("verdict: fine", "verdict: Input should be 'reproduced'"),
        ("compare: {left: 'toy/01-line:x', op: '<', right: 3}", "a metric or a compare, not both"),
        ("id: Not An Id", "Not An Id: id: String should match"),
    ],
)
def test_malformed_entries_name_file_and_claim(toy, change, sentence):
    key = change.partition(":")[0]
    lines = [f"  {k}: {json.dumps(v)}" for k, v in BASE.items() if k != key]
    (toy / "book" / "toy" / "claims.yml").write_text("-\n" + "\n".join([*lines, f"  {change}"]) + "\n")
    with pytest.raises(Fault, match=f"^book/toy/claims.yml, claim .*{sentence}"):
        claims.ledger(toy, "toy")


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("a: [", "book/toy/claims.yml, line 1: "),
        ("- id: a\n  id: b\n", 'duplicate key "id"'),
        ("a: 1", "holds no list of claims"),
        ("- 5", "claim number 1"),
        (
            "- {id: a, where: x, source: x, says: x, verdict: not-testable}",
            "claim a: a claim that nothing decides needs a reason",
        ),
        (2 * "- {id: a, where: x, source: x, says: x, reason: x, verdict: not-testable}\n", "claim a: the id is taken"),
    ],
)
def test_malformed_ledgers(toy, text, sentence):
    (toy / "book" / "toy" / "claims.yml").write_text(text)
    with pytest.raises(Fault, match=sentence):
        claims.ledger(toy, "toy")


def test_unknown_paper(toy):
    with pytest.raises(Misuse, match="'boy' has no ledger .*; papers with one are toy"):
        claims.ledger(toy, "boy")


def test_a_key_may_hold_what_a_recorded_name_may():
    assert make(metric="toy/01-line:a-b.c+d").metrics == ["toy/01-line:a-b.c+d"]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"kind": "control"}, "a claim has a verdict, a control or an erratum has none"),
        ({"kind": "control", "verdict": None}, "a control says holds"),
        ({"kind": "control", "verdict": None, "holds": True}, "nothing of it is printed"),
        ({"holds": True}, "a control says holds"),
        ({"text": "a"}, "an erratum quotes the text, another entry does not"),
        ({"kind": "erratum", "verdict": None}, "an erratum quotes the text"),
        ({"kind": "erratum", "verdict": None, "text": "a", "should": "b"}, "not decided by a number"),
        ({"kind": "claim", "verdict": None}, "a claim has a verdict"),
    ],
)
def test_each_kind_of_entry_has_its_own_fields(change, sentence):
    with pytest.raises(ValidationError, match=sentence):
        make(**change)


RULES = """
about: {means: about a number, between: [0.5, 2]}
clearly: {means: clearly more, factors: [2]}
range: {means: the printed range}
"""


@pytest.mark.parametrize(
    ("entry", "accepted"),
    [
        ("printed: 4, rule: about, metric: 'toy/01-line:x'", (2.0, 8.0)),
        ("printed: -4, rule: about, metric: 'toy/01-line:x'", (-8.0, -2.0)),
        ("printed: 4, reads: 40, because: a zero, rule: about, metric: 'toy/01-line:x'", (20.0, 80.0)),
        ("printed: one to two, rule: range, metric: 'toy/01-line:x', accept: {range: [1, 2]}", (1.0, 2.0)),
        ("rule: clearly, compare: {left: 'toy/01-line:x', op: '>', right: 2, factor: 0.5}", None),
    ],
)
def test_the_rule_of_its_kind_says_what_is_accepted(toy, entry, accepted):
    (toy / "book" / "rules.yml").write_text(RULES)
    (toy / "book" / "toy" / "claims.yml").write_text(
        f"- {{id: a, where: x, source: x, says: x, verdict: reproduced, {entry}}}"
    )
    accept = claims.ledger(toy, "toy")[0].accept
    assert (accept and (accept.min, accept.max)) == accepted


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ("printed: 4, rule: roughly, metric: 'toy/01-line:x'", "rule 'roughly' is none of about, clearly, range"),
        ("printed: 4, rule: about, metric: 'toy/01-line:x', accept: {rel: 1}", "rule about says what is accepted"),
        ("printed: four, rule: about, metric: 'toy/01-line:x'", "rule about needs a printed"),
        (
            "rule: clearly, compare: {left: 'toy/01-line:x', op: '>', right: 2}",
            "rule clearly compares with one of 2, 0.5, not 1",
        ),
        ("requires: [b], reason: x", "it requires b, which is no claim of this ledger"),
    ],
)
def test_an_entry_keeps_to_its_rule(toy, entry, sentence):
    (toy / "book" / "rules.yml").write_text(RULES)
    (toy / "book" / "toy" / "claims.yml").write_text(
        f"- {{id: a, where: x, source: x, says: x, verdict: not-testable, {entry}}}"
    )
    with pytest.raises(Fault, match=f"^book/toy/claims.yml, claim a: {sentence}"):
        claims.ledger(toy, "toy")


def test_malformed_rules_name_the_file(toy):
    for text in ("about: 5", "- about", "about: {between: [1, 2]}"):
        (toy / "book" / "rules.yml").write_text(text)
        with pytest.raises(Fault, match=r"^book/rules.yml: "):
            claims.ledger(toy, "toy")
