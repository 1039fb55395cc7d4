"""Parameters: what a comment means, what a value must be, and one sentence for what is wrong."""

from itertools import pairwise

import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from execbook import parameters
from execbook.errors import Fault, Misuse

CELL = """
days = 30.0         # (0, 400] d: length of the simulation
n_max = 70          # [2, 360]: degree and order
integrator = "gj"   # {gj, dop853, rk45}: gj is Gauss-Jackson
stencils = [5, 7]   # [3, 21]: points of the stencil
radii = [0, 2.5]    # [0, inf) km: smoothing
field = ""          # path: an ICGEM .gfc file
step = None         # (0, 600] float s: None is the integrator's own
words = []          # list[str]: any
kbr = True          #: use it
argp = 0.5
"""
QUICK = 'quick = {"days": 5.0}'


def make(cell=CELL, quick=QUICK):
    cells = [new_code_cell(cell.strip(), metadata={"tags": ["parameters"]})]
    if quick:
        cells.append(new_code_cell(quick, metadata={"tags": ["quick"]}))
    return parameters.specification(new_notebook(cells=cells), "toy/x")


def test_comment_gives_range_unit_and_help():
    p = make().parameters
    days = p["days"]
    assert (days.type, days.range, days.unit, days.default, days.help) == (
        "float",
        "(0, 400]",
        "d",
        30.0,
        "length of the simulation",
    )
    assert (p["integrator"].range, p["integrator"].help) == ("{gj, dop853, rk45}", "gj is Gauss-Jackson")
    assert [p[k].type for k in ("n_max", "stencils", "radii", "field", "step", "words", "kbr", "argp")] == [
        "int", "list[int]", "list[float]", "path", "float or None", "list[str]", "bool", "float",
    ]  # fmt: skip
    assert p["step"].unit == "s" and p["argp"].help == ""
    assert p["radii"].range == "[0, inf)"


@pytest.mark.parametrize(
    "word, value",
    [
        ("days=5", 5.0),
        ("days=1e-3", 1e-3),  # YAML 1.1 would read text
        ("days=1e1", 10.0),
        ("n_max=30", 30),
        ("integrator=rk45", "rk45"),
        ("stencils=[5,9]", [5, 9]),
        ("radii=[0, 300]", [0.0, 300.0]),
        ("step=null", None),
        ("step=1e-12", 1e-12),
        ("kbr=false", False),
        ("words=[]", []),  # the default is empty too
        ("words=[no, 12:30]", ["no", "12:30"]),  # YAML 1.1 would read false and 750
        ("argp=-.5", -0.5),
        ("field=", ""),
    ],
)
def test_command_line_words(word, value):
    [(_, found)] = make().parse([word]).items()
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize(
    "word, sentence",
    [
        (
            "dayz=5",
            r"dayz is no parameter of toy/x \(did you mean days\?\); the valid ones are days, n_max, .*argp",
        ),
        (
            "days=five",
            r"days='five' is not float; days must be a number in \(0, 400\] d \(length of the simulation\)\.",
        ),
        ("days=true", "days=True is not float"),
        ("days=0", r"days=0 is out of range; days must be a number in \(0, 400\]"),
        ("days=.inf", "days=inf is not finite"),
        ("days=.nan", "days=nan is not finite"),
        ("days=1e400", "days=inf is not finite"),
        ("days=[5]", r"days=\[5\] is not float"),
        ("n_max=5.5", r"n_max=5.5 is not int; n_max must be a whole number in \[2, 360\]"),
        ("n_max=361", "n_max=361 is out of range"),
        (
            "integrator=euler",
            r"integrator='euler' is none of the choices; integrator must be text in \{gj, dop853, rk45\}",
        ),
        (
            "stencils=5",
            r"stencils=5 is not list\[int\]; stencils must be a list, each item a whole number in \[3, 21\]",
        ),
        ("stencils=[5, 1]", r"stencils\[1\]=1 is out of range"),
        ("stencils=[5, 7", r"stencils=\[5, 7 is not a YAML value"),
        ("stencils=abc", r"stencils='abc' is not list\[int\]"),
        ("kbr=1", "kbr=1 is not bool; kbr must be true or false"),
        ("step=0", r"step=0 is out of range; step must be a number in \(0, 600\] s or None"),
        (
            "field=missing.gfc",
            r"field=missing.gfc: /.*/missing.gfc does not exist; field must be the path of an existing file \(an ICGEM .gfc file\)\.",
        ),
        ("field=/", "field=/: / is a folder; field must be the path of an existing file"),
        ("stencils=[]", r"stencils = \[\] is empty; give at least one value\."),
        ("days", "'days' is no assignment; write name=value"),
        ("=5", "'=5' is no assignment"),
    ],
)
def test_wrong_words_say_value_place_and_remedy(word, sentence):
    with pytest.raises(Misuse, match=sentence) as caught:
        make().parse([word])
    assert "\n" not in str(caught.value)


HOSTILE = {
    "many brackets": ("stencils=" + "[" * 900, "is not a YAML value (it is nested too deeply); stencils must be a list"),
    "many braces": ("days=" + "{" * 900, "is not a YAML value (it is nested too deeply)"),
    "many questions": ("days=" + "? " * 900, "is not a YAML value (it is nested too deeply)"),
    "many dashes": ("days=" + "- " * 900, "is not a YAML value (it is nested too deeply)"),
    "a list of itself": ("stencils=&a [*a]", "is not a YAML value (anchors, aliases and tags are not read)"),
    "billions": (
        "stencils=[&a [x,x,x,x,x,x,x,x,x], " + ", ".join(f"&{b} [{f'*{a},' * 9}]" for a, b in pairwise("abcdefghi")) + "]",
        "is not a YAML value (anchors, aliases and tags are not read)",
    ),
    "code": ("days=!!python/object/apply:os.system [ls]", "(anchors, aliases and tags are not read)"),
    "code by its full name": ("days=!<tag:yaml.org,2002:python/name:os.system>", "tags are not read"),
    "a wrong tag": ("days=!!timestamp x", "tags are not read"),
    "a merge": ("days={<<: 3}", "is not a YAML value (expected a mapping"),
    "a long whole number": ("days=" + "9" * 900, "is not finite; days must be a number in (0, 400] d"),
    "a longer one": ("n_max=" + "9" * 999, "... is out of range; n_max must be a whole number in [2, 360]"),
    "the longest": ("n_max=" + "9" * 9999, "is not a YAML value (Exceeds the limit"),
    "not a number": ("radii=[.nan]", "radii[0]=nan is not finite"),
    "below all": ("argp=-.inf", "argp=-inf is not finite"),
    "above all": ("argp=1e400", "argp=inf is not finite"),
    "a date": ("days=2020-01-01", "days=datetime.date(2020, 1, 1) is not float"),
    "a tab": ("days=\t5", r"days='\t5' is not a YAML value (found character '\t'"),
    "lines": ("days=5\n6", "days='5 6' is not float"),
    "documents": ("days=--- 5\n--- 6", r"days='--- 5\n--- 6' is not a YAML value (line 2: but found another document)"),
    "bell": ("days=\a", r"days='\x07' is not a YAML value (unacceptable character #x0007"),
    "not UTF-8": ("days=\udcff", r"days='\udcff' is not a YAML value (unacceptable character #xdcff"),
    "not UTF-8 in text": ("title=\udcff", r"title='\udcff' is not plain text (a control character, or bytes that"),
    "lines in text": ("title=a\nb", "title='a b'"),
    "escapes in text": (r'title="a\n\0b"', r"title='a\n\x00b' is not plain text"),
    "half of a pair": (r'title="\ud800"', r"title='\ud800' is not plain text"),
    "long": ("days=" + "x" * 100000, "xxx... is not float; days must be a number"),
    "a long name": ("x" * 100000 + "=1", "xxx... is no parameter of toy/x; the valid ones are"),
    "a long word": ("x" * 100000, "xxx... is no assignment; write name=value"),
    "many items": ("stencils=[" + "5," * 2000 + "1]", "stencils[2000]=1 is out of range"),
    "a home of nobody": ("field=~nobody-of-that-name/x", "field=~nobody-of-that-name/x: ~nobody-of-that-name/x cannot"),
    "a long path": ("field=" + "x" * 9000, "xxx... cannot be reached (File name too long); field must be the path"),
    "a device": ("field=/dev/null", "field=/dev/null: /dev/null is neither file nor folder; field must be the path"),
    "a zero byte": (r'field="a\0b"', r"field='a\x00b': 'a\x00b' cannot be reached (embedded null byte)"),
}  # fmt: skip


@pytest.mark.parametrize("word, sentence", HOSTILE.values(), ids=HOSTILE)
def test_no_value_is_worse_than_one_sentence(word, sentence):
    with pytest.raises(Misuse) as caught:
        make(CELL + 'title = "x"  # {x, y}: any\n').parse([word])
    text = str(caught.value)
    assert sentence in text and text.isprintable() and len(text) < 1300


def test_a_loop_of_links_is_no_file(tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(Misuse, match=r"field=loop: .*loop (does not exist|cannot be reached \(.*\)); field must be"):
        make().parse(["field=loop"], tmp_path)


def test_a_path_below_a_file_or_a_forbidden_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(Misuse, match="file/x does not exist; field must be"):
        make().parse(["field=file/x"], tmp_path)


def test_a_parameter_given_twice():
    with pytest.raises(Misuse, match="days is given twice"):
        make().parse(["days=1", "days=2"])


def test_paths_are_relative_to_the_caller(tmp_path):
    (tmp_path / "own.gfc").write_text("x")
    assert make().parse(["field=own.gfc"], tmp_path) == {"field": str(tmp_path / "own.gfc")}


def test_folders_are_relative_to_the_caller_and_must_be_folders(tmp_path):
    (tmp_path / "day").mkdir()
    (tmp_path / "file").write_text("x")
    spec = make('data_dir = ""  # folder: Level-1 files', None)
    assert spec.parameters["data_dir"].type == "folder"
    assert spec.parse(["data_dir=day"], tmp_path) == {"data_dir": str(tmp_path / "day")}
    for name, what in (("file", "is a file"), ("none", "does not exist")):
        with pytest.raises(
            Misuse,
            match=rf"data_dir={name}: .* {what}; data_dir must be the path of an existing folder \(Level-1 files\)\.",
        ):
            spec.parse([f"data_dir={name}"], tmp_path)


def test_numpy_numbers_become_plain_ones():
    found = make().check(
        {"days": np.float32(2), "n_max": np.int64(8), "stencils": np.array([5, 9]), "kbr": np.bool_(False)}
    )
    assert found == {"days": 2.0, "n_max": 8, "stencils": [5, 9], "kbr": False}
    assert [type(v) for v in found.values()] == [float, int, list, bool]


def test_mode():
    spec = make()
    assert spec.changed(spec.defaults | {"days": 5.0, "stencils": [5, 7]}) == {"days": 5.0}
    assert spec.mode(spec.defaults) == "paper"
    assert spec.mode(spec.defaults | {"days": 5.0}) == "quick"
    assert spec.mode(spec.defaults | {"days": 6.0}) == "custom"


@pytest.mark.parametrize(
    "cell, quick, sentence",
    [
        ("a = b + 1", None, "toy/x: line 1 of the parameters cell: 'b \\+ 1' is no literal"),
        ("a = 1\nprint(a)", None, "line 2 of the parameters cell, 'print\\(a\\)', is no assignment"),
        ("a = 5  # [0, 1]: x", None, "line 1 of the parameters cell: a=5 is out of range"),
        ("a = None  # s: x", None, "a = None has no clear type"),
        ("a = []  # s: x", None, r"a = \[\] has no clear type"),
        ("a = 1  # {1, x}: x", None, "the choice 'x' is not a whole number"),
        ("a = 1", "quick = {'b': 2}", "toy/x: b is no parameter"),
        ("a = 1", "quick = 5", "quick = 5 is no dictionary"),
        ("a = 1", "x = 5", "the cell tagged quick must be one assignment"),
    ],
)
def test_malformed_cells(cell, quick, sentence):
    with pytest.raises(Fault, match=sentence):
        make(cell, quick)
