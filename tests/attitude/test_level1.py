"""Readers of Level-1 files and what can be wrong with headers, records and times: said, or mended and said."""

from __future__ import annotations

import numpy as np
import pytest
from level1files import DATE, columns_of, edit, written

from geokalman.attitude import write
from geokalman.attitude.header import END, Level1Error
from geokalman.attitude.level1 import Level1Warning, read
from geokalman.attitude.model import EPOCH_2019
from geokalman.attitude.products import GRACE_FO


@pytest.mark.parametrize("product", sorted(GRACE_FO))
def test_reading_gives_back_what_was_written(tmp_path, product):
    columns = columns_of(product)
    table = read(write.write(tmp_path, product, "Y" if product == "KBR1B" else "C", DATE, columns), product)
    for name, values in columns.items():
        np.testing.assert_array_equal(table[name], values)
    assert table.notes == () and len(table) == 200 and table.product == product


# --- 1: header ---


def test_headers_that_are_none_are_refused(tmp_path):
    path = written(tmp_path)
    whole = path.read_text()
    path.write_text(whole.replace(END, "#"))
    with pytest.raises(Level1Error, match=r"SCA1B_2019.*no line '# End of YAML header'"):
        read(path)
    path.write_text(whole.replace("header:", "header: [", 1))
    with pytest.raises(Level1Error, match=r"SCA1B_.*line \d+: the header is not YAML"):
        read(path)
    path.write_text("- 1\n" + END + "\n")
    with pytest.raises(Level1Error, match="line 1: the YAML header has no mapping"):
        read(path)
    path.write_text("")
    with pytest.raises(Level1Error, match="no line"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("id: SCA1B_simulated", "id: IMU1B_simulated", "the header's title|the header's id"),
        ("platform: GRACE-C", "platform: GRACE-D", "platform is GRACE-D, the file name says C"),
        ("time_coverage_start: 2019-01-01", "time_coverage_start: 2019-01-03", "the header covers 2019-01-03"),
        ("num_records: 200", "num_records: many", "num_records is 'many'"),
        ("- name: quatangle", "- name: angle", "variables lack quatangle"),
        ("- name: qual_rss", "- name: quatangle", "lack qual_rss|twice"),
    ],
)
def test_headers_of_another_file_are_refused(tmp_path, old, new, message):
    path = written(tmp_path)
    text = path.read_text()
    if "IMU1B" in new:
        text = text.replace("title: GRACE-FO Level-1 SCA1B", "title: GRACE-FO")
        message = "the header's id says IMU1B|id says"
        new = "id: IMU1B simulated"
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(Level1Error, match=message):
        read(path)


def test_names_and_expectations(tmp_path):
    path = written(tmp_path)
    for expected, message in (
        ({"product": "ACT1B"}, "product SCA1B in the file name, ACT1B"),
        ({"satellite": "D"}, "satellite C"),
        ({"date": "2019-01-02"}, "date 2019-01-01"),
    ):
        with pytest.raises(Level1Error, match=message):
            read(path, **expected)
    with pytest.raises(Level1Error, match="the name is not"):
        read(path.rename(tmp_path / "attitude.txt"))
    with pytest.raises(Level1Error, match="product XYZ1B is unknown"):
        read(tmp_path / f"XYZ1B_{DATE}_C_04.txt")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / f"SCA1B_{DATE}_C_04.txt")


def test_records_of_another_satellite_are_refused(tmp_path):
    path = written(tmp_path)
    k = edit(path, lambda body: [line.replace(" C ", " D ", 1) for line in body])
    with pytest.raises(Level1Error, match=f"line {k + 1}: a record says satellite D, the file name C"):
        read(path)


def test_columns_follow_the_header(tmp_path):
    """Section 4: where the header lists its variables, another order and unknown columns are read by it."""
    path = written(tmp_path)
    lines = path.read_text().splitlines()
    k = lines.index(END)
    first = lines.index("  - name: gps_time")
    blocks = "\n".join(lines[first:k]).split("  - name: ")[1:]
    blocks = [*blocks[1:], blocks[0].rstrip("\n") + "\n", 'novelty\n    comment: "10th column"\n']
    header = [*lines[:first], *"".join("  - name: " + b.rstrip("\n") + "\n" for b in blocks).splitlines(), END]
    body = [" ".join([*line.split()[1:], line.split()[0], "hello"]) for line in lines[k + 1 :]]
    path.write_text("\n".join([*header, *body, ""]))
    table = read(path)
    np.testing.assert_array_equal(table["gps_time"], columns_of("SCA1B")["gps_time"])
    np.testing.assert_array_equal(table["quatkcoeff"], columns_of("SCA1B")["quatkcoeff"])
    assert "novelty" not in table.columns


# --- 2: counts, cut lines ---


def test_a_cut_last_line_and_a_wrong_count_are_mended_and_said(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: [*body[:-1], body[-1][:20]])
    with pytest.warns(Level1Warning) as seen:
        table = read(path)
    text = " ".join(str(w.message) for w in seen)
    assert (
        len(table) == 199
        and "is cut short" in text
        and "199 records, the header promises 200" in text
        and path.name in text
    )


def test_half_of_the_records_is_too_few(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: body[:90])
    with pytest.raises(Level1Error, match="90 records of the 200"):
        read(path)
    edit(path, lambda body: [])
    with pytest.raises(Level1Error, match="0 records of the 200|no records"):
        read(path)


# --- 3, 4, 6: bad records ---


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda f: f[:-1], "8 columns, 9 are expected"),
        (lambda f: [*f, "1"], "10 columns, 9 are expected"),
        (lambda f: [*f[:4], "0.1x", *f[5:]], "column 5 .quaticoeff. is '0.1x', not a number"),
        (lambda f: [*f[:4], "1_0", *f[5:]], "column 5 .quaticoeff. is '1_0', not a number"),
        (lambda f: [*f[:4], "nan", *f[5:]], "column 5 .quaticoeff. is nan"),
        (lambda f: [*f[:7], "inf", *f[8:]], "column 8 .qual_rss. is inf"),
        (lambda f: [f[0] + ".5", *f[1:]], "column 1 .gps_time. is .* not an integer"),
        (lambda f: ["9" * 25, *f[1:]], "no 64-bit integer"),
        (lambda f: [*f[:3], "0", "0", "0", "0", *f[7:]], "the quaternion has the norm 0"),
        (lambda f: [*f[:3], "1.01", "0", "0", "0", *f[7:]], "the quaternion has the norm 1.01"),
        (lambda f: [*f[:8], "0000x000"], "not a string of 0 and 1"),
        (lambda f: [*f[:2], "7" * 60, *f[3:]], "60 characters long"),
    ],
)
def test_a_bad_record_is_left_out_with_its_line(tmp_path, change, reason):
    path = written(tmp_path)
    k = edit(path, lambda body: [*body[:50], " ".join(change(body[50].split())) + "\n", *body[51:]])
    with pytest.warns(Level1Warning, match=f"1 bad record left out .line {k + 51}: .*{reason}"):
        table = read(path)
    assert len(table) == 199 and EPOCH_2019 + 50 not in table["gps_time"]


def test_more_than_a_percent_of_bad_records_is_refused(tmp_path):
    path = written(tmp_path)
    k = edit(path, lambda body: ["x\n"] * 3 + body[3:])
    with pytest.raises(Level1Error, match=rf"line {k + 1}: 1 column, .*3 of 200 records are bad"):
        read(path)


def test_microseconds_out_of_range_are_bad(tmp_path):
    path = written(tmp_path, "IMU1A")
    edit(path, lambda body: [" ".join([body[0].split()[0], "1000000", *body[0].split()[2:]]) + "\n", *body[1:]])
    with pytest.warns(Level1Warning, match=r"column 2 \(time_frac\) is 1000000, outside 0 to 999999"):
        assert len(read(path)) == 199


def test_gyro_angles_beyond_their_range_are_bad(tmp_path):
    path = written(tmp_path, "IMU1A")
    k = edit(
        path, lambda body: [*body[:3], " ".join([*body[3].split()[:5], "9999.0", body[3].split()[6]]) + "\n", *body[4:]]
    )
    with pytest.warns(Level1Warning, match=rf"line {k + 4}: column 6 \(FiltAng\) is 9999.0, outside -5759 to 5759"):
        assert len(read(path)) == 199


def test_duplicates_and_backward_time_are_mended_and_said(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: [*body[:10], body[4], *body[20:30], *body[10:20], *body[30:]])
    with pytest.warns(Level1Warning) as seen:
        table = read(path)
    text = " ".join(str(w.message) for w in seen)
    assert "sorted" in text and "1 duplicate time tag" in text
    np.testing.assert_array_equal(table["gps_time"], EPOCH_2019 + np.arange(200))
    np.testing.assert_array_equal(table["quatangle"], columns_of("SCA1B")["quatangle"])


def test_norms_a_little_off_are_mended_and_counted(tmp_path):
    columns = columns_of("SCA1B")
    columns["quatangle"][7] *= 1 + 1e-4
    path = write.write(tmp_path, "SCA1B", "C", DATE, columns)
    with pytest.warns(Level1Warning, match="1 quaternion with a norm off by up to"):
        table = read(path)
    q = table.stacked("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff")
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-9)
