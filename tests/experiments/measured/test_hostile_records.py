"""Records that ask for floods, for hours or for other files (hostile_records.py) are refused in one sentence."""

import numpy as np
import pytest
from scipy.io import savemat

import steadyslip as ss
from hostile_records import BYTES, CASES, SECONDS, is_sentence, outcome
from records_in_bytes import ROWS, columns, honest_workbook, in_workbook
from steadyslip.experiments.measured.formats import table, workbook
from steadyslip.files import apart

pytest.importorskip("h5py")
resource = pytest.importorskip("resource")  # where there is none, tests/files/test_apart.py has what limits there are
SOME = [
    "compound-arrays.h5", "never-written.h5", "external-numbers.h5", "link-to-a-pipe.h5", "damaged-2.h5",
    "cell-of-itself.mat", "structures-of-each-other.mat", "other-file.mat", "references-never-written.mat",
    "same-numbers-often.mat", "cells-that-are-not-there.mat", "cells-in-cells.mat", "damaged-1-5.mat",
    "one-number-often.parquet", "damaged-3.parquet", "entities.xlsx", "line-numbers.xlsx",
    "deep-elements.xlsx", "damaged-0.xlsx", "numbers-that-are-not-there.tdms", "long-name.tdms", "damaged-4.tdms",
    "numbers-that-are-not-there.nc", "same-bytes.nc", "quotes.csv", "blanks.txt", "damaged-5.csv",
    "many-headers.csv", "days-that-are-none.csv", "many-candidates.csv",
]  # fmt: skip


def spent():
    found = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in found), found[1].ru_maxrss * 1024


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("name", SOME)
def test_hostile_records_are_a_sentence(tmp_path, name):
    write, part = CASES[name]
    write(tmp_path / name)
    before, _ = spent()
    said = outcome(tmp_path / name, part)
    apart._end_all()
    seconds, most = spent()
    assert is_sentence(said)
    assert seconds - before < SECONDS
    assert most < BYTES
    assert not said.startswith("read") or name.startswith("damaged")


@pytest.mark.parametrize(
    ("name", "why"),
    [("compound-arrays.h5", "100000000 numbers; allowed: up to"), ("cell-of-itself.mat", "more members"),
     ("bomb.xlsx", "unpacks to .* too much for a table")],
)  # fmt: skip
def test_what_a_file_states_is_not_believed(tmp_path, name, why):
    """Each takes gigabytes, or never ends, when its library is let have its way."""
    if name == "bomb.xlsx":
        in_workbook(tmp_path / name, ["<row>", b"<c><v>1</v></c>" * 10**6, "</row>"])
    else:
        CASES[name][0](tmp_path / name)
    with pytest.raises(ss.NotAvailable, match=why):
        ss.read_record(tmp_path / name)


def test_a_cell_far_away_is_no_flood(tmp_path, monkeypatch):
    """Every row was counted as a thousand cells, so that 67109 rows were too many."""
    monkeypatch.setattr(table, "MOST_VALUES", 2000)
    CASES["far-cell.xlsx"][0](tmp_path / "r.xlsx")
    found = workbook.read(tmp_path / "r.xlsx", None)
    assert found.names == list(columns())
    assert found.values.shape == (4, ROWS)


def test_workbooks_that_others_write_are_read(tmp_path):
    """Rows and cells without places, other prefixes for names, texts in pieces, values of formulas, errors."""
    names = "".join(f'<c t="s"><v>{k}</v></c>' for k in range(4))
    strings = [f"<si><r><t>{n[:3]}</t></r><r><t>{n[3:]}</t></r><rPh><t>x</t></rPh></si>" for n in columns()]
    rows = [f"<row>{names}</row>"]
    for row in zip(*(c.tolist() for c in columns().values()), strict=True):
        rows.append("<row>" + "".join(f"<c><f>A1</f><v>{x!r}</v></c>" for x in row) + "</row>")
    rows.append('<row><c t="e"><v>#N/A</v></c><c t="b"><v>1</v></c></row>')
    in_workbook(tmp_path / "r.xlsx", rows, strings)
    record = ss.read_record(tmp_path / "r.xlsx")
    assert len(record) == ROWS
    assert record.friction[7] == columns()["mu"][7]


@pytest.mark.slow
@pytest.mark.campaign
def test_a_large_honest_workbook_is_read(tmp_path):
    honest_workbook(tmp_path / "r.xlsx", 70_000)
    before, _ = spent()
    assert len(ss.read_record(tmp_path / "r.xlsx")) == 70_000
    apart._end_all()
    assert spent()[0] - before < 20


@pytest.mark.slow
@pytest.mark.campaign
def test_a_large_honest_array_of_structures_is_read(tmp_path):
    """A row in each of more members than a file of version 7.3 may name."""
    own = columns(25_100)
    members = np.empty((1, 25_100), dtype=[(name, object) for name in own])
    for name, values in own.items():
        members[name][0] = values.tolist()
    savemat(tmp_path / "r.mat", {"rec": members})
    assert len(ss.read_record(tmp_path / "r.mat")) == 25_100
