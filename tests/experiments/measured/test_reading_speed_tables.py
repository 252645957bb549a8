"""Tables of friction at constant speeds as people write them: which columns are read, and what is said of others."""

import re

import numpy as np
import pytest

import steadyslip as ss
from command import run as command
from steadyslip.experiments.measured.speeds import read_speed_table

TEXTS = {
    "german": (
        "v [mm/min];Reibkraft (N);Last [kN]\n0,1;602,1;3,2\n0,5;590;3,2\n10;470,5;3,2\n",
        0.1 / 60e3,
        602.1,
        3200,
    ),
    "plain": ("speed,force,load\n0.001,60,300\n0.002,50,300\n0.01,40,300\n", 0.001, 60.0, 300),
    "joint": ("velocity_rad/s\ttorque_Nm\n0.1\t5\n0.2\t4\n1\t3.5\n", 0.1, 5.0, None),
    "rpm": ("n [1/min],M [Nm]\n3,5\n2,4\n30,3\n", 0.1 * np.pi, 5.0, None),
    "words": ("speed [m/min],F [N],direction\n6,7,backward\n2,6,forward\n1,7.5,forward\n", -0.1, 7.0, None),
    "signs": ("speed [m/min],F [N],direction\n6,-7,-\n2,6,+\n1,7.5,+\n", -0.1, 7.0, None),
    "slashes": ("n / min^-1;M_R / Nm\n3;5,5\n2;4\n30;3\n", 0.1 * np.pi, 5.5, None),
    "two rows of names": ("velocity;torque\ndeg/s;Nm\n180;5,5\n2;4\n30;3\n", np.pi, 5.5, None),
    "scatter": ("v (mm/s),F (N),σ (N),std of F (N)\n1,60,.6,.6\n2,50,.5,.5\n10,40,.4,.4\n", 0.001, 60.0, None),
    "mass": ("speed [mm/s],mu,load [kg]\n1,.2,100\n2,.18,100\n3,.17,100\n", 0.001, 0.2, 980.665),
}


@pytest.mark.parametrize("name", TEXTS)
def test_tables_are_read_as_printed(name, tmp_path):
    text, speed, friction, load = TEXTS[name]
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    found = read_speed_table(path)
    assert found.speed[0] == pytest.approx(speed, rel=1e-12)
    assert found.friction[0] == pytest.approx(friction)
    assert load is None if found.load is None else found.load[0] == pytest.approx(load)


def test_two_columns_of_friction_are_two_directions(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("v [mm/s], forward [N], backward [N]\n1,50,55\n2,40,44\n5,33,36\n", encoding="utf-8")
    found = read_speed_table(path)
    assert found.speed.tolist() == [0.001, 0.002, 0.005, -0.001, -0.002, -0.005]
    assert found.friction.tolist() == [50, 40, 33, 55, 44, 36]


def test_a_column_that_is_named_settles_which_of_two_it_is(tmp_path):
    path = tmp_path / "joint.csv"
    rows = ((1, 20), (2, 18), (5, 15), (10, 13), (20, 12), (50, 11.5), (100, 12))
    text = "".join(f"{speed};{torque};100\n" for speed, torque in rows)
    path.write_text("speed [1/min];Drehmoment [Nm];Moment 2 [Nm]\n" + text, encoding="utf-8")
    assert "say which with torque=NAME" in command("fit", path, "--law", "coulomb").stderr
    assert "mu_coulomb" in command("fit", path, "--law", "coulomb", "--set", "torque=Drehmoment").stdout


NO_VALUE = ("", "-", "–", "--", "n/a", "nan")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_cells_without_a_value_leave_their_row_out(tmp_path, separator, place):
    """A dash in a column of numbers was read as -1, the word for backward in a column of directions."""
    path, rows = tmp_path / "t.csv", [["1", "400", "9"], ["3", "350", "9"], ["9", "280", "8"], ["20", "230", "8"]]
    for cell in NO_VALUE:
        holed = [[*row[:place], cell, *row[place + 1 :]] if row[0] == "3" else row for row in rows]
        path.write_text("\n".join(map(separator.join, [["speed [mm/s]", "force [N]", "load [kN]"], *holed])) + "\n")
        found = read_speed_table(path)
        assert found.friction.tolist() == [400, 280, 230], (cell, separator)
        assert found.notes == ("1 row without a number left out",)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_columns_of_words_are_left_out_with_a_word(tmp_path, separator):
    rows = [["Lauf", "Datum", "v [m/min]", "F [N]", "Richtung", "Bemerkung"],
            ["1", "12,03,2024", "0,06", "389,2", "vor", "ok"], ["2", "12,03,2024", "0,18", "363,8", "vor", "-"],
            ["3", "13,03,2024", "0,48", "353,2", "zurück", "leicht feucht"], ["4", "", "0,9", "325,7", "vor", ""]
            ]  # fmt: skip
    (path := tmp_path / "t.csv").write_text("\n".join(map(separator.join, rows)) + "\n", encoding="utf-8")
    found = read_speed_table(path)
    assert found.speed * 60 == pytest.approx([0.06, 0.18, -0.48, 0.9])
    assert found.friction.tolist() == [389.2, 363.8, 353.2, 325.7]
    assert "left out, as it holds words: column 'Datum'" in found.notes
    assert "left out, as it holds words: column 'Bemerkung'" in found.notes


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("speed [mm/s];force\n1;400 N\n3;350 N\n9;280 N\n", "force: holds words, such as '400 N'; allowed: numbers"),
        (
            "speed [mm/s];force [N];direction\n1;400;vor\n3;350;up\n9;280;down\n",
            "direction: holds words, such as 'up'; allowed: forward and backward, vor and zurück, + and -, 1 and -1",
        ),
    ],
)
def test_words_in_a_column_that_is_needed_are_named(tmp_path, rows, words):
    (path := tmp_path / "t.csv").write_text(rows)
    with pytest.raises(ss.ParameterError, match=r"t\.csv: ") as caught:
        read_speed_table(path)
    assert words in str(caught.value)


BAD = {
    "speed [rpm],force [N]\n1,5\n2,4\n3,3\n": "got speeds in rpm and a force",
    "a,b\n1,5\n2,4\n3,3\n": "has no column for it",
    "speed [mm/s],force [N]\n1,5\n2,-4\n3,3\n": "of one sign in each direction",
    "speed [mm/s],force [N],load [N]\n1,5,0\n2,4,1\n3,3,1\n": "loads above 0",
    "speed [mm/s],F1 [N],F2 [N]\n1,5,0\n2,4,1\n3,3,1\n": "several columns could be it",
    "speed [mm/s],force [N]\n1,5\n2,4\n": "of sliding; a table of speeds has 3 at least",
    "speed [mm/s],force [N]\n1,5\n2,4\n3,4\n": "needs 3 speeds in 4 rows at least",
    "speed [N],force [N]\n1,5\n2,4\n3,4\n": "several columns could be it",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_table_is_one_sentence(text, tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    said = command("fit", path, "--law", "lugre")
    assert said.returncode == 2
    assert BAD[text] in said.stderr
    assert len(said.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("speed [mm/min],F [kg]", "F [kg]: kg is a mass: write kgf for the reading of a balance"),
        ("speed [rpm],torque [kg cm]", "torque [kg cm]: kg cm is a mass: write kgf cm"),
        ("speed [rpm],torque [%]", "torque [%]: % is a share: multiply it by the rated value, and write N m"),
        ("speed [rpm],Drehmoment [A]", "Drehmoment [A]: A is none of its units: write N m; multiply a current"),
        ("speed [m],torque [Nm]", "speed [m]: m is none of its units: write m/s or rad/s"),
    ],
)
def test_a_column_in_another_unit_is_named_with_it(tmp_path, header, words):
    path = tmp_path / "table.csv"
    path.write_text(f"{header}\n1,5\n2,4\n5,3.9\n10,3.8\n")
    with pytest.raises(ss.ParameterError) as caught:
        read_speed_table(path)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["load", "Normalkraft", "preload", "normal stress"])
@pytest.mark.parametrize(
    ("size", "advice"),
    [("bar", "bar is a pressure: multiply it by the area"), ("V", "V is none of its units: .* voltage .* N/V"),
     ("mm", "mm is none of its units: write N"), ("%", "% is a share: multiply it by the rated value")],
)  # fmt: skip
def test_a_load_in_another_unit_is_refused(tmp_path, name, size, advice):
    """It was left out without a word, so that coefficients came out as forces."""
    (path := tmp_path / "t.csv").write_text(f"speed [mm/s],force [N],{name} [{size}]\n1,5,3\n2,4,3\n5,3.9,3\n")
    words = re.escape(f"{name} [{size}]: ") + advice + '.*; or give one load of all rows, --set load="3.2 kN"'
    with pytest.raises(ss.ParameterError, match=words):
        read_speed_table(path)
    read = read_speed_table(path, load="40 N")
    assert read.load == pytest.approx([40.0] * 3)
    assert f"not used: column '{name} [{size}]'" in read.notes


@pytest.mark.parametrize("head", ["T [°C]", "T [C]", "t (K)", "Temp [°C]", "n [V]", "p [bar]", "t [s]", "No."])
def test_other_columns_are_left_out_with_a_word(tmp_path, head):
    """A temperature T was taken for a torque."""
    (path := tmp_path / "t.csv").write_text(f"{head},speed [mm/s],force [N]\n20,1,5\n20,2,4\n21,5,3.9\n")
    read = read_speed_table(path)
    assert read.friction == pytest.approx([5, 4, 3.9])
    assert read.notes == (f"not used: column '{head}'",)


@pytest.mark.parametrize("option", ["load=3 bar", "load=foo", "load=0", "radius=3 bar", "radius=-1 mm"])
def test_an_option_that_is_not_valid_is_named(tmp_path, option):
    name = option.split("=")[0]
    header = "speed [rpm],torque [N m]" if name == "radius" else "speed [mm/s],force [N]"
    (path := tmp_path / "t.csv").write_text(f"{header}\n1,5\n2,4\n5,3.9\n9,3.8\n")
    said = command("fit", path, "--law", "coulomb", "--set", option)
    assert said.returncode == 2
    assert f"t.csv: {name}: got " in said.stderr
    assert f"allowed: a {name} in {'m' if name == 'radius' else 'N'} above 0" in said.stderr
    assert "[contacts" not in said.stderr


def test_coefficients_in_per_cent_and_loads_named_m_are_read(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("speed [mm/min],mu [%],m [kg]\n1,15,10\n2,14,10\n5,13,10\n")
    read = read_speed_table(path)
    assert read.is_coefficient
    assert read.friction == pytest.approx([0.15, 0.14, 0.13])
    assert read.load == pytest.approx([98.0665] * 3)


def test_a_table_without_a_header_is_told_what_to_write(tmp_path):
    (file := tmp_path / "t.csv").write_text("0.1,610\n0.5,600\n2,548\n5,487\n")
    with pytest.raises(ss.ParameterError, match=r"no header to name its .* such as: speed \[mm/min\], force \[N\]"):
        read_speed_table(file)


def test_exchanged_columns_are_noticed_and_others_are_not(tmp_path):
    """Random Stribeck curves with viscous drag over three decades of speed and of load, as they are and exchanged."""
    chance, file = np.random.default_rng(33), tmp_path / "t.csv"
    for _ in range(200):
        speed = np.geomspace(*sorted(10 ** chance.uniform(-6, 1, 2)), 8) * [1, 1, 1, 1, 1, 1, 1, 1.5]
        mu = 10 ** chance.uniform(-3, 0) * (1 + chance.uniform(0, 8) * np.exp(-speed / 10 ** chance.uniform(-6, 0)))
        load = 10 ** chance.uniform(0, 4, 8) if chance.integers(2) else np.full(8, 100.0)
        force = load * (mu + speed * 10 ** chance.uniform(-3, 2)) * (1 + 0.02 * chance.normal(size=8))
        rows = "\n".join(
            f"{a!r},{b!r},{c!r}" for a, b, c in zip(*map(np.ndarray.tolist, (speed, force, load)), strict=True)
        )
        file.write_text(f"speed [m/s],force [N],load [N]\n{rows}\n")
        assert not [note for note in read_speed_table(file).notes if "names of the two columns" in note]
    force, speed = 100 * np.linspace(1.0, 0.6, 8), np.geomspace(1e-4, 1e-1, 8)
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(force.tolist(), speed.tolist(), strict=True))
    file.write_text(f"speed [mm/min],force [N]\n{rows}\n")
    notes = "; ".join(read_speed_table(file).notes)
    assert "force varies by a factor of 1000 over speeds that vary by 1.7: if the names of the two columns are" in notes


QUESTIONS = {
    "columns exchanged": (
        "force [N],speed [mm/min]\n1,838\n3,773\n6,706\n12,605\n20,532\n",
        "force varies by a factor of 20 over speeds that vary by 1.6: .* exchange them in the header",
    ),
    "a load in kN": (
        "speed [mm/min],force [N],load\n1,838,5.5\n3,773,5.5\n25,502,5.5\n200,454,5.5\n",
        r'force over load of 120, where friction coefficients are 0.001 to 2: is "load \[kN\]" or',
    ),
    "load and force exchanged": (
        "speed [mm/min],force [kN],load [N]\n1,5.5,838\n3,5.5,773\n25,5.5,502\n200,5.5,454\n",
        "force over load of 9, .* or the columns of force and load exchanged meant",
    ),
    "coefficients in per cent": ("speed [mm/s],mu\n1,16\n3,14\n25,10\n60,9\n", r'of 12, .* is "friction \[%\]" meant'),
    "speeds without a unit": (
        "v,F [N]\n1,800\n3,700\n10,500\n30,400\n",
        r"speeds up to 30 m/s\? Write their unit in the header, speed \[mm/min\], or give --set speed=mm/min",
    ),
    "speeds of a slide in m/s for mm/s": (
        "speed [m/s],force [N]\n1,400\n3,350\n9,280\n20,230\n60,210\n",
        r"speeds up to 60 m/s\? They are in m/s in the header; guides reach 5 m/s, brakes 50 m/s",
    ),
    "a direction without load": (
        "speed [rpm],torque [Nm],load [Nm]\n10,2.4,10\n30,2.1,10\n90,1.7,10\n300,1.4,10\n900,1.2,10\n"
        "-10,1.5,0\n-30,1.25,0\n-90,1,0\n-300,0.75,0\n-900,0.62,0\n",
        "backward: 5 rows left out, as no coefficient follows from a load of 0 N m throughout: give the loads, or",
    ),
    "speeds in another unit": ("v [m/s],F [N]\n1,800\n30,500\n600,400\n", r"up to 600 m/s\? They are in m/s in the"),
    "a weight": (
        "speed [mm/min],force [N]\n10,950\n60,930\n200,920\n-10,350\n-60,370\n-200,380\n",
        "force is 930 N forward and 370 N backward at like speeds: if a weight .* half their difference, 280 N",
    ),
    "a weight less than friction": (
        "speed [mm/min],force [N]\n10,950\n60,930\n200,920\n-10,-350\n-60,-370\n-200,-380\n",
        "force is 930 N forward and -370 N backward at like speeds: if a weight .* half their difference, 650 N",
    ),
}


@pytest.mark.parametrize(("text", "words"), QUESTIONS.values(), ids=QUESTIONS)
def test_numbers_that_are_not_of_friction_are_asked_about_once(tmp_path, text, words):
    """In the answer, and in the rig file that goes on."""
    (path := tmp_path / "t.csv").write_text(text)
    (question,) = read_speed_table(path).questions
    assert re.search(words, question)
    found = ss.experiments.fit_friction_table(path, "coulomb")
    assert f"  to check: {question}\n" in str(found)
    assert f"# To check: {question}\n" in found.rig_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed [mm/min],force [N]\n1,-8\n3,-7\n12,-6\n", "force is negative at 3 forward speeds: .* speeds negative"),
        ("speed [mm/min],force [N]\n-1,8\n-3,7\n-12,6\n", "all speeds are negative: the friction is that of backward"),
    ],
)
def test_signs_that_are_left_out_are_told(tmp_path, text, words):
    (path := tmp_path / "t.csv").write_text(text)
    assert re.search(words, "; ".join(read_speed_table(path).notes))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "speed [rpm],force [N]\n1,8\n3,7\n12,6\n",
            "multiply rpm by the lead of the screw, in mm/rev, or the",
        ),
        (
            "speed,torque [N m]\n1,8\n3,7\n12,6\n",
            r"the speeds have no unit: write it in the header, such as speed",
        ),
        ("speed [mm/s],force [N]\n1,8\n3,7\n12,-6\n", "give rows of the other direction a negative speed or a column"),
    ],
)
def test_refusals_name_what_to_write(tmp_path, text, words):
    (path := tmp_path / "t.csv").write_text(text)
    with pytest.raises(ss.ParameterError, match=words):
        read_speed_table(path)
