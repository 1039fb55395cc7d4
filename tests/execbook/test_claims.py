"""The ledger: what an entry must say, and which verdict follows."""

import json
import math

import pytest
from pydantic import ValidationError

from execbook import blocks, claims, ledger, multiverse, verdicts
from execbook.errors import Fault, Misuse

BASE = {
    "id": "c", "where": "Table 1", "source": "Table 1, row 2", "says": "something", "printed": 2.0, "unit": "m",
    "metric": "toy/01-line:x", "accept": {"rel": 0.1}, "verdict": "reproduced",
}  # fmt: skip


def make(**change):
    return claims.Claim.model_validate({k: v for k, v in (BASE | change).items() if v is not None})


def metrics(value, unit="m"):
    return lambda notebook: (
        {"x": {"value": value, "unit": unit}, "y": {"value": 10.0, "unit": "m"}} if notebook == "toy/01-line" else None
    )


@pytest.mark.parametrize(
    "change, ours, verdict",
    [
        ({}, 2.1, "reproduced"),
        ({}, 2.3, "not-reproduced"),
        ({}, -2.0, "not-reproduced"),
        ({"accept": {"abs": 0.5}}, 2.4, "reproduced"),
        ({"accept": {"abs": 0.5}}, 2.6, "not-reproduced"),
        ({"accept": {"factor": 2}}, 1.0, "reproduced"),
        ({"accept": {"factor": 2}}, 4.1, "not-reproduced"),
        ({"accept": {"factor": 2}}, -2.0, "not-reproduced"),
        ({"accept": {"range": [3, 4]}}, 3.5, "reproduced"),
        ({"accept": {"range": [3, 4]}, "printed": "three to four"}, 2.9, "not-reproduced"),
        ({"reads": 20.0, "because": "a zero is missing"}, 20.5, "reproduced"),
        ({"reads": 20.0, "because": "a zero is missing"}, 2.0, "not-reproduced"),
        ({"assumes": "smoothing"}, 2.0, "depends-on-the-reading"),
        ({"assumes": "smoothing"}, 5.0, "not-reproduced"),
        ({"assumes": "smoothing", "calibrated": "mu"}, 2.0, "calibrated"),
        ({"assumes": "smoothing", "calibrated": "mu"}, 5.0, "not-reproduced"),
        ({}, None, "not-reproduced"),
        ({"metric": None, "accept": None, "reason": "data not public"}, 2.0, "not-testable"),
    ],
)
def test_the_most_critical_word_that_applies(change, ours, verdict):
    judgement = claims.judge(make(**change), metrics(ours))
    assert judgement.verdict == verdict and judgement.as_expected == (verdict == "reproduced")


@pytest.mark.parametrize(
    "comparisons, verdict",
    [
        ({"left": "toy/01-line:x", "op": "<", "right": "toy/01-line:y"}, "reproduced"),
        ({"left": "toy/01-line:x", "op": ">", "right": "toy/01-line:y"}, "not-reproduced"),
        ({"left": "toy/01-line:x", "op": "<", "right": "toy/01-line:y", "factor": 0.2}, "not-reproduced"),
        ({"left": "toy/01-line:x", "op": "<=", "right": 2}, "reproduced"),
        (
            [{"left": "toy/01-line:x", "op": ">=", "right": 2}, {"left": "toy/01-line:x", "op": ">", "right": 2}],
            "not-reproduced",
        ),
    ],
)
def test_comparisons(comparisons, verdict):
    claim = make(metric=None, accept=None, printed=None, compare=comparisons)
    assert claims.judge(claim, metrics(2.0)).verdict == verdict


@pytest.mark.parametrize(
    "change, ours, margin",
    [({}, 2.19, 0.01 / 2.2), ({}, 2.21, 0.01 / 2.2), ({}, 1.81, 0.01 / 1.8), ({"accept": {"range": [0, 4]}}, 3.0, 0.25),
     ({"accept": {"factor": 2}}, 1.1, 0.1), ({"accept": {"abs": 0}}, 2.0, None), ({}, None, None),
     ({"metric": None, "accept": None, "compare": {"left": "toy/01-line:x", "op": "<", "right": "toy/01-line:y",
                                                   "factor": 0.5}}, 4.9, 0.02)],
)  # fmt: skip
def test_distance_from_the_nearest_threshold(change, ours, margin):
    judged = claims.judge(make(**change), metrics(ours))
    assert judged.margin == (None if margin is None else pytest.approx(margin))
    assert judged.is_near == (margin is not None and margin <= 0.0201)


def test_a_comparison_shows_both_sides():
    claim = make(
        metric=None, accept=None, compare={"left": "toy/01-line:x", "op": "<", "right": "toy/01-line:y", "factor": 0.1}
    )
    assert claims.judge(claim, metrics(2.0)).ours == "2.000 m (x) not < 0.1 × 10.00 m (y)"


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


def test_what_is_not_recorded_is_not_judged():
    judgement = claims.judge(make(metric="toy/01-line:z"), metrics(2.0))
    assert judgement.verdict is None and judgement.why == "toy/01-line:z is not recorded" and not judgement.as_expected
    assert claims.judge(make(metric="toy/09-none:z"), metrics(2.0)).verdict is None


def test_units_must_agree():
    with pytest.raises(Fault, match="claim c is in m, but toy/01-line:x is recorded in km"):
        claims.judge(make(), metrics(2.0, "km"))
    lengths = make(metric=None, accept=None, compare={"left": "toy/01-line:x", "op": "<", "right": "toy/01-line:y"})
    with pytest.raises(
        Fault, match="claim c compares toy/01-line:x, recorded in km, with toy/01-line:y, recorded in m"
    ):
        claims.judge(lengths, metrics(2.0, "km"))
    assert claims.judge(lengths, metrics(2.0, "")).verdict == "reproduced"


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


def test_which_claims_a_notebook_decides(toy):
    assert [c.id for c in claims.decided_by(toy, "toy/01-line")] == ["mean"]
    assert claims.decided_by(toy, "toy/02-constant") == []  # `steeper` needs both


def write_metrics(root, mean):
    for name, value in (
        ("01-line", {"line.mean": {"value": mean, "unit": "m"}}),
        ("02-constant", {"quotient": {"value": 3.0, "unit": ""}}),
    ):
        path = root / "book" / "_build" / "metrics" / "toy" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value))


def test_tables_and_readme(toy):
    with pytest.raises(Misuse, match="claims are not computed yet: call make book, then"):
        verdicts.readme_with_block(toy)
    assert verdicts.readme_agrees(toy)  # nothing can differ yet
    write_metrics(toy, 49.0)
    first = verdicts.row(claims.judge_paper(toy, "toy")[0])
    assert first == ["Table 1: the mean of the line", "49\u00a0m", "49.00\u00a0m", "reproduced", "accepted ±0.1 %"]
    assert verdicts.summary_markdown(toy).splitlines()[2] == "| [The toy paper](toy/index.md) | 2 | 2 | 0 | 0 | 0 | 0 |"
    assert not verdicts.readme_agrees(toy)
    (toy / "README.md").write_text(verdicts.readme_with_block(toy))
    assert verdicts.readme_agrees(toy) and "(book/toy/index.md) | 2 | 2 |" in (toy / "README.md").read_text()
    write_metrics(toy, 48.0)
    assert not verdicts.readme_agrees(toy)
    (toy / "README.md").write_text(
        "# Toy\n\n<!-- verdicts -->\n<!-- /verdicts -->\n\nThe end.\n"
    )  # nothing between yet
    (toy / "README.md").write_text(verdicts.readme_with_block(toy))
    assert verdicts.readme_agrees(toy)
    assert (toy / "README.md").read_text().endswith(" |\n<!-- /verdicts -->\n\nThe end.\n")
    assert [e["verdict"] for e in verdicts.as_json(toy, "toy")] == ["not-reproduced", "reproduced"]
    (toy / "README.md").write_text("no block")
    with pytest.raises(Fault, match="README.md lacks the lines <!-- verdicts -->"):
        verdicts.readme_agrees(toy)


@pytest.mark.parametrize(
    "change, printed, why",
    [
        ({"printed": 5.26357e-6}, "5.26357\u00a0×\u00a010⁻⁶\u00a0m", "accepted ±10 %"),
        ({"printed": "about two", "accept": {"range": [1, 3]}}, "about two", "accepted 1.000 to 3.000"),
        (
            {"printed": 20, "reads": 2.0, "because": "a zero too many"},
            "20\u00a0m; read as 2\u00a0m",
            "a zero too many; accepted ±10 %",
        ),
    ],
)
def test_a_row_shows_print_reading_and_reason(change, printed, why):
    says, shown, ours, _, reason = verdicts.row(claims.judge(make(**change), metrics(2.0)))
    assert (says, shown, ours, reason) == ("Table 1: something", printed, "2.000\u00a0m", why)


def test_before_anything_was_computed(toy):
    assert "not computed" in verdicts.summary_markdown(toy)


@pytest.mark.parametrize(
    ("accept", "low", "high"),
    [({"abs": 0.5}, 1.5, 2.5), ({"rel": 0.25}, 1.5, 2.5), ({"factor": 2}, 1.0, 4.0), ({"range": [3, 4]}, 3.0, 4.0)],
)
def test_the_edge_of_what_is_accepted_belongs_to_it(accept, low, high):
    for ours in (low, high):
        assert claims.judge(make(accept=accept), metrics(ours)).verdict == "reproduced"
    for ours in (math.nextafter(low, -math.inf), math.nextafter(high, math.inf)):
        assert claims.judge(make(accept=accept), metrics(ours)).verdict == "not-reproduced"


@pytest.mark.parametrize(
    ("narrowest", "narrower"),
    [({"abs": 0}, {"abs": -0.1}), ({"rel": 0}, {"rel": -0.1}), ({"factor": 1}, {"factor": 0.9}),
     ({"range": [2, 2]}, {"range": [2, 1.9]})],
)  # fmt: skip
def test_nothing_is_narrower_than_equality(narrowest, narrower):
    assert claims.judge(make(accept=narrowest), metrics(2.0)).verdict == "reproduced"
    assert claims.judge(make(accept=narrowest), metrics(2.0001)).verdict == "not-reproduced"
    with pytest.raises(ValidationError):
        make(accept=narrower)


def test_a_factor_has_a_sign_and_a_zero_is_no_multiple():
    negative = make(printed=-2.0, accept={"factor": 2})
    assert [claims.judge(negative, metrics(x)).verdict for x in (-3.0, 3.0, 0.0)] == [
        "reproduced", "not-reproduced", "not-reproduced",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("op", "holds"), [("<", [True, False, False]), ("<=", [True, True, False]), (">", [False, False, True]),
                      (">=", [False, True, True]), ("=", [False, True, False])],
)  # fmt: skip
def test_every_comparison_below_at_and_above(op, holds):
    claim = make(metric=None, accept=None, compare={"left": "toy/01-line:x", "op": op, "right": 1.5, "factor": 2})
    found = [claims.judge(claim, metrics(x)).verdict == "reproduced" for x in (2.5, 3.0, 3.5)]
    assert found == holds


def test_numbers_that_are_one_but_for_rounding_are_equal_and_near_nothing():
    claim = make(metric=None, accept=None, compare={"left": "toy/01-line:x", "op": "=", "right": 3.0})
    found = [claims.judge(claim, metrics(3.0 * (1 + off))) for off in (9e-7, -9e-7, 1.1e-6, -1.1e-6)]
    assert [j.verdict for j in found] == ["reproduced", "reproduced", "not-reproduced", "not-reproduced"]
    assert not any(j.is_near for j in found)


def test_all_comparisons_must_hold_in_any_order():
    good, bad = ({"left": "toy/01-line:x", "op": op, "right": 1.0} for op in "><")
    for comparisons in ([good, bad], [bad, good]):
        judgement = claims.judge(make(metric=None, accept=None, compare=comparisons), metrics(2.0))
        assert judgement.verdict == "not-reproduced" and judgement.ours.count("not") == 1


@pytest.mark.parametrize(
    ("change", "ours", "why"),
    [
        ({}, 2.0, "accepted ±10 %"),
        ({"accept": {"abs": 0.5}}, 2.0, "accepted ±0.5000"),
        ({"accept": {"factor": 2}}, 2.0, "accepted within a factor 2"),
        ({"accept": {"range": [1, 3]}}, 2.0, "accepted 1.000 to 3.000"),
        ({"reason": "chaos", "assumes": "smoothing"}, 9.0, "chaos; accepted ±10 %"),
        ({"assumes": "smoothing"}, 2.0, "smoothing; accepted ±10 %"),
        ({"assumes": "smoothing", "calibrated": "mu"}, 2.0, "mu; accepted ±10 %"),
        ({}, None, "toy/01-line:x is not finite"),
        ({"metric": None, "accept": None, "reason": "not public"}, 2.0, "not public"),
    ],
)
def test_the_reason_that_is_given(change, ours, why):
    assert claims.judge(make(**change), metrics(ours)).why == why


@pytest.mark.parametrize(
    ("value", "digits"), [(0.9073, 4), (5.26357e-6, 6), (1.23456789, 6), (20.0, 1), (100, 1), (-3.5, 2)]
)
def test_printed_digits(value, digits):
    assert verdicts._digits(value) == digits


def test_the_ledger_for_scripts(toy):
    write_metrics(toy, 49.0)
    first, second = verdicts.as_json(toy, "toy")
    assert first == {
        "paper": "toy", "id": "mean", "kind": "claim", "where": "Table 1", "source": "Table 1, first row",
        "says": "the mean of the line", "printed": 49.0, "unit": "m", "metric": "toy/01-line:line.mean", "compare": [],
        "accept": {"rel": 1e-3}, "evidence": [], "requires": [], "history": [], "ours": 49.0, "holds": True,
        "expected": "reproduced", "verdict": "reproduced", "why": "accepted ±0.1 %", "share": None, "decided_by": None,
        "margin": pytest.approx(1e-3, rel=0.01), "link": "toy/01-line.html#verdicts-toy-01-line",
    }  # fmt: skip
    assert second["ours"] == "49.00 m (line mean) > 10 × 3.000 m (quotient)" and second["verdict"] == "reproduced"


@pytest.mark.parametrize(
    ("change", "ours", "part", "verdict"),
    [
        ({}, 2.0, 0.9, "reproduced"),
        ({}, 9.0, 0.9, "reproduced"),  # what the readings say outranks the one world
        ({}, 2.0, 0.89, "depends-on-the-reading"),
        ({}, 2.0, 0.11, "depends-on-the-reading"),
        ({}, 2.0, 0.1, "not-reproduced"),
        ({"calibrated": "mu"}, 2.0, 0.95, "calibrated"),
        ({"calibrated": "mu"}, 2.0, 0.5, "calibrated"),
        ({"calibrated": "mu"}, 2.0, 0.1, "not-reproduced"),
        ({"assumes": "smoothing"}, 2.0, 1.0, "reproduced"),
    ],
)
def test_a_share_of_the_readings_decides(change, ours, part, verdict):
    share = multiverse.Share(part, 100, {}, None)
    assert claims.judge(make(**change), metrics(ours), share).verdict == verdict


@pytest.mark.parametrize(
    ("part", "near"), [(0.9, True), (0.87, True), (0.92, True), (0.8, False), (0.1, True), (0.12, True), (1.0, False)]
)
def test_a_share_within_its_error_of_a_limit_is_near(part, near):
    judged = claims.judge(make(), metrics(2.19), multiverse.Share(part, 100, {}, None))
    assert judged.is_near is near  # though the number of the one world is near its threshold


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


def test_controls_and_errata_have_no_verdict_and_are_not_counted(toy):
    path = toy / "book" / "toy" / "claims.yml"
    control = (
        "- {id: own, kind: control, where: here, source: ours, says: it is flat, holds: false,"
        ' compare: {left: "toy/01-line:line.mean", op: "<", right: 1}}\n'
    )
    erratum = "- {id: sign, kind: erratum, where: (2), source: equation 2, says: a sign, text: -a, should: a}\n"
    path.write_text(path.read_text() + control + erratum)
    write_metrics(toy, 49.0)
    *_, own, sign = claims.judge_paper(toy, "toy")
    assert (own.verdict, own.holds, own.as_expected) == (None, False, True)
    assert (sign.verdict, sign.holds, sign.as_expected) == (None, None, True)
    assert "| 2 | 2 | 0 |" in verdicts.summary_markdown(toy)
    assert [verdicts.outcome(j) for j in (own, sign)] == ["does not hold", "erratum"]
    assert [e["verdict"] for e in verdicts.as_json(toy, "toy")] == ["reproduced", "reproduced", None, None]


def test_a_failure_is_told_to_what_rests_on_it(toy):
    path = toy / "book" / "toy" / "claims.yml"
    last = "- {id: last, where: x, source: x, says: x, reason: lost, verdict: not-testable, requires: [steeper]}\n"
    path.write_text(path.read_text().replace("  verdict", "  requires: [mean]\n  verdict") + last)
    path.write_text(path.read_text().replace("  requires: [mean]\n", "", 1))  # the first rests on nothing
    write_metrics(toy, 48.0)
    mean, steeper, last = claims.judge_paper(toy, "toy")
    assert mean.verdict == "not-reproduced" and "rests on" not in mean.why
    assert steeper.verdict == "reproduced" and steeper.why == "rests on mean, which is not reproduced"
    assert last.why == "lost; rests on mean, which is not reproduced"  # at one remove


READINGS = """
- {id: slope, asks: how steep is it?, passage: section 2, default: 2, range: [1, 3]}
- id: sign
  asks: which way does it go?
  passage: section 3
  default: up
  options: [{id: up, says: upwards}, {id: down, says: downwards}]
"""
SHARES = {
    "share.mean": 0.5, "count.mean": 100, "part.sign.up.mean": 1.0, "part.sign.down.mean": 0.0,
    "part.slope.below.mean": 0.5, "part.slope.above.mean": 0.5, "most.claims": 1, "most.worlds": 50,
    "most.sign.up": 1.0, "most.sign.down": 0.0, "most.slope.below": 0.48, "most.slope.above": 0.52,
}  # fmt: skip


def test_what_a_paper_leaves_open_is_ranked_by_what_it_decides(toy):
    (toy / "book" / "toy" / "readings.yml").write_text(READINGS)
    write_metrics(toy, 49.0)
    path = toy / "book" / "_build" / "metrics" / "toy" / "90-readings.json"
    path.write_text(json.dumps({key: {"value": value, "unit": ""} for key, value in SHARES.items()}))
    mean = claims.judge_paper(toy, "toy")[0]
    assert mean.verdict == "depends-on-the-reading" and mean.share.decided_by == "sign"
    assert verdicts.outcome(mean) == "depends on the reading, 50\u00a0%"
    assert verdicts.row(mean)[4].endswith(
        "holds in 50\u00a0% of 100 readings; sign decides (up 100\u00a0%, down 0\u00a0%)"
    )
    entry = verdicts.as_json(toy, "toy")[0]
    assert (entry["share"], entry["decided_by"], entry["verdict"]) == (0.5, "sign", "depends-on-the-reading")
    _, (first, second) = verdicts.settled(toy)
    assert first[1:] == [
        "which way does it go?<br><small>section 3</small>",
        '<details><summary>1</summary><small><a href="toy/index.html#claim-mean">mean</a></small></details>',
        "up 100\u00a0%",
    ]  # fmt: skip
    assert second[2:] == ["0", "above 52\u00a0%, below 48\u00a0%"]
    assert "depends on the reading, 50\u00a0%" in blocks.fill("<!-- verdicts: toy -->", toy)
    assert "which way does it go?" in blocks.fill("<!-- settled -->", toy)


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


def test_columns_that_nothing_fills_are_left_out_of_a_notebooks_claims(toy):
    numbers = {"line.mean": {"value": 49.0, "unit": "m"}}
    header, rows, caption = verdicts.of_notebook(toy, "toy/01-line", numbers, judged=True)
    assert header == ["The paper says", "Printed", "Ours", "Holds here", "Why"] and rows[0][3] == "yes"
    header, rows, caption = verdicts.of_notebook(toy, "toy/01-line", numbers, judged=False)
    assert header == ["The paper says", "Printed", "Ours"] and "nothing is judged" in caption
    assert rows == [["Table 1: the mean of the line", "49\u00a0m", "49.00\u00a0m"]]
    assert verdicts.of_notebook(toy, "toy/02-constant", {}, judged=True)[0] == ["The paper says", "Ours"]
