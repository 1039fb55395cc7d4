"""Verdicts: which follows from an entry of the ledger and our numbers, and how it is shown."""

import json
import math

import pytest
from ledgerentries import make
from pydantic import ValidationError

from execbook import blocks, claims, multiverse, verdicts
from execbook.errors import Fault, Misuse


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
    bar = '<div class="verdict-bar"><span class="verdict-reproduced" style="flex-grow: 2">2</span></div>'
    assert bar in verdicts.bars(toy) and verdicts.bars(toy).index("legend") < verdicts.bars(toy).index("The toy paper")
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


def test_columns_that_nothing_fills_are_left_out_of_a_notebooks_claims(toy):
    numbers = {"line.mean": {"value": 49.0, "unit": "m"}}
    header, rows, caption = verdicts.of_notebook(toy, "toy/01-line", numbers, judged=True)
    assert header == ["The paper says", "Printed", "Ours", "Holds here", "Why"] and rows[0][3] == "yes"
    header, rows, caption = verdicts.of_notebook(toy, "toy/01-line", numbers, judged=False)
    assert header == ["The paper says", "Printed", "Ours"] and "nothing is judged" in caption
    assert rows == [["Table 1: the mean of the line", "49\u00a0m", "49.00\u00a0m"]]
    assert verdicts.of_notebook(toy, "toy/02-constant", {}, judged=True)[0] == ["The paper says", "Ours"]
