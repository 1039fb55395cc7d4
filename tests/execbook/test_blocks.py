"""Numbers of the book in the prose of its pages."""

import json

from execbook import blocks


def test_a_runs_own_numbers_stand_in_its_prose(tmp_path):
    def filled(lenient: bool) -> str:
        text = "It is [[p/01-a:error.rms]]; [[p/01-a:none]], [[p/01-a:missing]], [[p/02-b:other]], [[p/02-b:gone]]."
        return blocks.fill_own(text, tmp_path, "p/01-a", metrics, lenient).replace("\xa0", " ")

    metrics = {"error.rms": {"value": 1.2345e-6, "unit": "rad"}, "none": {"value": None, "unit": ""}}
    book = tmp_path / "book" / "_build" / "metrics" / "p" / "02-b.json"
    book.parent.mkdir(parents=True)
    book.write_text(json.dumps({"other": {"value": 2.0, "unit": "m"}}))
    assert filled(lenient=False) == "It is 1.23 × 10⁻⁶ rad; –, [[p/01-a:missing]], [[p/02-b:other]], [[p/02-b:gone]]."
    assert filled(lenient=True) == "It is 1.23 × 10⁻⁶ rad; –, –, 2.00 m, –."
