import dataclasses
import math
import re

import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.identification.measurement import Measurement, read_measurement

HEADER = ("time", "angle", "torque", "elbow_flexor", "elbow_extensor")


def table(header=HEADER, samples=120, **columns):
    """A header and rows of a plausible elbow sampled at 1 kHz, as text cells."""
    time = np.arange(samples) * 1e-3
    known = {
        "time": [f"{t:.3f}" for t in time],
        "angle": [f"{a:.6f}" for a in 1.0 + 0.5 * np.sin(10 * time)],
        "torque": [f"{t:.3f}" for t in np.cos(10 * time)],
        "elbow_flexor": [f"{u:.2f}" for u in np.where(time > 0.02, 0.5, 0.0)],
        "elbow_extensor": ["0"] * samples,
        **columns,
    }
    cells = [known.get(title.partition(" [")[0], ["0"] * samples) for title in header]
    return [list(header), *map(list, zip(*cells, strict=True))]


def write(tmp_path, rows, delimiter=",", before="", after="\n", newline="\n", encoding="utf-8"):
    path = tmp_path / "measured.csv"
    text = before + newline.join(delimiter.join(row) for row in rows) + after
    path.write_bytes(text.encode(encoding))
    return path


def edited(line, title, cell):
    """The plausible table with one cell changed, at a line of the file that holds it alone."""
    rows = table()
    rows[line - 1][HEADER.index(title)] = cell
    return rows


def refused(path, joint, *parts):
    """The message with which a file is refused; it starts with the file and has the parts."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_measurement(path, joint)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    for part in parts:
        assert part in message
    return message


def test_a_plain_file_is_read_in_si(tmp_path, elbow):
    path = write(tmp_path, table())
    measurement = read_measurement(path, elbow)
    time = np.arange(120) * 1e-3
    assert measurement.source == str(path)
    assert len(measurement) == 120
    np.testing.assert_allclose(measurement.time, time, atol=1e-12)
    np.testing.assert_allclose(measurement.angle, 1.0 + 0.5 * np.sin(10 * time), atol=1e-6)
    np.testing.assert_allclose(measurement.torque, np.cos(10 * time), atol=1e-3)
    assert list(measurement.excitation) == ["elbow_flexor", "elbow_extensor"]
    np.testing.assert_array_equal(measurement.excitation["elbow_flexor"], (time > 0.02) * 0.5)
    np.testing.assert_array_equal(measurement.excitation["elbow_extensor"], np.zeros(120))


def test_a_recording_with_an_applied_torque_is_a_measurement_bit_for_bit(tmp_path, elbow, pair):
    with mjhill.installed():
        recording = mjhill.record(
            pair,
            rest(pair),
            duration=0.2,
            excitation={"elbow_flexor": mjhill.step(0.6, 0.05)},
            torque={"elbow": mjhill.pulse(2.0, 0.02, 0.05)},
        )
    path = recording.save(tmp_path / "run.csv")
    measurement = read_measurement(path, elbow)
    np.testing.assert_array_equal(measurement.time, recording.time)
    np.testing.assert_array_equal(measurement.angle, recording["elbow.angle"])
    np.testing.assert_array_equal(measurement.torque, recording["elbow.applied"])
    assert np.ptp(measurement.torque) == 2.0
    for muscle, values in measurement.excitation.items():
        np.testing.assert_array_equal(values, recording[f"{muscle}.u"])


def test_a_recording_without_a_torque_says_to_add_one(tmp_path, elbow, pair):
    with mjhill.installed():
        recording = mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": 0.6})
    path = recording.save(tmp_path / "run.csv")
    refused(
        path,
        elbow,
        "row 2, column 'torque': a column torque is missing",
        "'torque' or 'elbow.applied'",
        "the columns found are: 'time [s]', 'elbow.angle [rad]', 'elbow.velocity [rad/s]'",
        "add one, or give the external torque if it was constant: torque=0",
    )


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [
        ("time", "s", 1.0),
        ("time", "ms", 1e-3),
        ("angle", "rad", 1.0),
        ("angle", "deg", math.pi / 180),
        ("angle", "°", math.pi / 180),
        ("torque", "N·m", 1.0),
        ("torque", "Nm", 1.0),
        ("torque", "N m", 1.0),
        ("torque", "N.m", 1.0),
        ("torque", "N⋅m", 1.0),
        ("torque", "mN·m", 1e-3),
        ("torque", "N·mm", 1e-3),
        ("elbow_flexor", "-", 1.0),
        ("elbow_flexor", "1", 1.0),
        ("elbow_flexor", "none", 1.0),
        ("elbow_flexor", "%", 1e-2),
    ],
)
def test_units_are_converted(tmp_path, elbow, quantity, unit, factor):
    plain = read_measurement(write(tmp_path, table()), elbow)
    series = {**dataclasses.asdict(plain), **plain.excitation}
    cells = [repr(value) for value in (series[quantity] / factor).tolist()]
    header = [f"{name} [{unit}]" if name == quantity else name for name in HEADER]
    path = write(tmp_path, table(header, **{quantity: cells}))
    read = read_measurement(path, elbow)
    found = {**dataclasses.asdict(read), **read.excitation}[quantity]
    np.testing.assert_allclose(found, series[quantity], rtol=1e-14)


@pytest.mark.parametrize(
    ("title", "allowed"),
    [
        ("time [deg]", "of time; it must be one such as s, ms;"),
        ("angle [%]", "of angle; it must be one such as deg, rad, mrad;"),
        ("torque [N]", "of torque; it must be one such as N·m, N·mm, lbf·ft;"),
        ("elbow_flexor [mV]", "it must be one such as - or 1 (a share of the maximum), %;"),
        ("elbow_flexor [deg]", "of excitation; it must be one such as"),
        ("torque [9**9**9]", "of torque; it must be one such as"),
    ],
)
def test_a_unit_of_something_else_names_the_column_and_lists_those_allowed(
    tmp_path, elbow, title, allowed
):
    name, _, unit = title.partition(" ")
    rows = table([title if known == name else known for known in HEADER])
    place = f"row 1, column {title!r}: unknown unit {unit[1:-1]!r}"
    refused(write(tmp_path, rows), elbow, place, allowed)


def test_names_of_recordings_spaces_and_other_columns_are_accepted(tmp_path, elbow):
    header = (
        "note",
        " elbow.applied[ Nm ]",
        "elbow_extensor.u  [-]",
        "elbow_flexor.u []",
        "elbow.angle",
        "time [s]",
        "",
    )
    rows = table(HEADER)
    order = ("torque", "elbow_extensor", "elbow_flexor", "angle", "time")
    mixed = [["n/a", *(row[HEADER.index(name)] for name in order), "nan"] for row in rows[1:]]
    read = read_measurement(write(tmp_path, [list(header), *mixed]), elbow)
    (tmp_path / "plain").mkdir()
    plain = read_measurement(write(tmp_path / "plain", rows), elbow)
    np.testing.assert_array_equal(read.angle, plain.angle)
    np.testing.assert_array_equal(read.torque, plain.torque)
    for muscle in elbow.muscles:
        np.testing.assert_array_equal(read.excitation[muscle], plain.excitation[muscle])


def test_one_excitation_alone_drives_the_muscle_that_pulls_towards_positive_angles(tmp_path, elbow):
    cells = ["0"] * 20 + ["40"] * 100
    header = ("time", "angle", "torque", "excitation [%]")
    read = read_measurement(write(tmp_path, table(header, excitation=cells)), elbow)
    assert elbow.gears["elbow_flexor"] < 0  # shortens as the angle grows
    np.testing.assert_array_equal(read.excitation["elbow_flexor"], [0.0] * 20 + [0.4] * 100)
    np.testing.assert_array_equal(read.excitation["elbow_extensor"], np.zeros(120))


def test_an_excitation_beside_a_named_one_is_refused(tmp_path, elbow):
    path = write(tmp_path, table(("time", "angle", "torque", "elbow_flexor.u", "excitation")))
    refused(
        path,
        elbow,
        "row 1, column 'excitation'",
        "must be the only excitation, but there is 'elbow_flexor.u' too",
        "name it after its muscle: elbow_flexor or elbow_extensor",
    )


def test_a_muscle_without_a_column_is_refused(tmp_path, elbow):
    path = write(tmp_path, table(("time", "angle", "torque", "elbow_flexor")))
    refused(
        path,
        elbow,
        "row 1, column 'elbow_extensor': a column elbow_extensor is missing",
        "the columns found are: 'time', 'angle', 'torque', 'elbow_flexor'",
        "with zeros if it was at rest",
        "it drives 'elbow_flexor'",
    )


@pytest.mark.parametrize("missing", ["time", "angle", "torque"])
def test_a_missing_column_lists_those_found(tmp_path, elbow, missing):
    header = [name for name in HEADER if name != missing]
    found = ", ".join(map(repr, header))
    path = write(tmp_path, table(header), before="# by hand\n")
    place = f"row 2, column {missing!r}: a column {missing} is missing"
    refused(path, elbow, place, f"the columns found are: {found};")


def test_a_header_of_one_cell_says_how_to_separate_them(tmp_path, elbow):
    path = write(tmp_path, table(), delimiter=" ")
    separators = "separate the cells by commas, semicolons or tabs"
    refused(path, elbow, "row 1, column 'time'", f"found are: {' '.join(HEADER)!r}", separators)


@pytest.mark.parametrize(
    ("header", "both", "quantity"),
    [
        (("time", "time [ms]"), "'time' and 'time [ms]'", "time"),
        (("time", "angle", "elbow.angle"), "'angle' and 'elbow.angle'", "angle"),
        (("time", "angle", "torque", "torque [Nm]"), "'torque' and 'torque [Nm]'", "torque"),
        (
            (*HEADER, "elbow_flexor.u"),
            "'elbow_flexor' and 'elbow_flexor.u'",
            "excitation of elbow_flexor",
        ),
        (
            ("time", "angle", "torque", "excitation", "excitation [%]"),
            "'excitation' and 'excitation [%]'",
            "excitation",
        ),
    ],
)
def test_two_columns_for_one_quantity_are_refused(tmp_path, elbow, header, both, quantity):
    path = write(tmp_path, table(header))
    place = f"row 1, column {header[-1]!r}: {both} each hold the {quantity};"
    refused(path, elbow, place, "remove or rename")


@pytest.mark.parametrize(
    "form",
    [
        {"delimiter": ";"},
        {"delimiter": "\t"},
        {"encoding": "utf-8-sig"},
        {"encoding": "utf-8-sig", "delimiter": ";", "before": '# {"model": "x; y;z;;;;'},
        {"newline": "\r\n"},
        {"newline": "\r"},
        {"after": ""},
        {"after": "\n\n  \n,,,,\n\n"},
        {"newline": "\r\n", "after": "\r\n\r\n\r\n", "encoding": "utf-8-sig"},
        {"before": '# an "odd quote, and "more'},
        {"before": "\n\n"},
    ],
    ids=str,
)
def test_the_common_forms_of_csv_are_the_same_measurement(tmp_path, elbow, form):
    plain = read_measurement(write(tmp_path, table()), elbow)
    header = ("time", "angle [rad]", "torque [N·m]", "elbow_flexor", "elbow_extensor [-]")
    before = form.get("before", "")
    form = {**form, "before": before + "\n" if before else ""}
    read = read_measurement(write(tmp_path, table(header), **form), elbow)
    np.testing.assert_array_equal(read.time, plain.time)
    np.testing.assert_array_equal(read.angle, plain.angle)
    np.testing.assert_array_equal(read.torque, plain.torque)


def test_quoted_cells_are_read(tmp_path, elbow):
    plain = read_measurement(write(tmp_path, table()), elbow)
    rows = [[f'"{cell}"' for cell in row] for row in table()]
    read = read_measurement(write(tmp_path, rows, delimiter=", "), elbow)
    np.testing.assert_array_equal(read.angle, plain.angle)


def test_rows_are_counted_from_the_top_of_the_file(tmp_path, elbow):
    rows = edited(10, "torque", "x")
    path = write(tmp_path, rows, before="# by hand\n\n", newline="\r\n", encoding="utf-8-sig")
    refused(path, elbow, "row 12, column 'torque': 'x' is not a number")
    assert path.read_text("utf-8-sig").split("\n")[11].split(",")[2] == "x"


def test_a_missing_file_says_so(tmp_path, elbow):
    path = tmp_path / "nowhere.csv"
    with pytest.raises(FileNotFoundError, match=f"{re.escape(str(path))}: there is no such file"):
        read_measurement(path, elbow)


def test_a_folder_is_refused(tmp_path, elbow):
    refused(tmp_path, elbow, "is a folder, not a text CSV")


@pytest.mark.parametrize(
    "content",
    [b"\x93NUMPY\x01\x00", b"time,angle\n0,\x00\n", b"time,angle\n\x81\x8d\n"],
    ids=["binary", "zero byte", "no encoding"],
)
def test_a_file_that_is_not_text_is_refused(tmp_path, elbow, content):
    path = tmp_path / "measured.csv"
    path.write_bytes(content)
    refused(path, elbow, "is not a text CSV; save it as CSV in UTF-8")


@pytest.mark.parametrize("text", ["", "\n\n", "# only this\n", "\ufeff"])
def test_an_empty_file_is_refused(tmp_path, elbow, text):
    path = tmp_path / "measured.csv"
    path.write_text(text, encoding="utf-8")
    refused(path, elbow, "row 1: the file is empty")


@pytest.mark.parametrize("after", ["", "\n", "\n\n,,,,\n"])
def test_a_header_alone_is_refused(tmp_path, elbow, after):
    path = write(tmp_path, table()[:1], before="# by hand\n", after=after)
    refused(path, elbow, "row 2: no rows follow the header")


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        (["0.005", "1.0"], ("column 'torque': the cell is empty",)),
        (["0.005", "1", "0", "0", "0", "0"], ("column 'elbow_extensor': the row has 6 cells",)),
        (["0,005", "1", "0", "0", "0"], ("the row has 6 cells", "write decimal points")),
        (["  "], ("column 'time': the row is blank", "remove it")),
        ([], ("column 'time': the row is blank", "remove it")),
        ([""] * 5, ("column 'time': the row is blank", "remove it")),
        (["", "1", "0", "0", "0"], ("column 'time': the cell is empty",)),
    ],
)
def test_a_row_that_does_not_fit_the_header_is_refused(tmp_path, elbow, row, parts):
    rows = table()
    rows[6] = row
    refused(write(tmp_path, rows), elbow, "row 7, ", *parts)


def test_a_quote_that_is_not_closed_is_refused(tmp_path, elbow):
    refused(write(tmp_path, edited(9, "angle", '"1.0')), elbow, "row 9: is not CSV")


@pytest.mark.parametrize("title", ["time", "angle", "torque", "elbow_flexor"])
@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        ("", "the cell is empty; it must hold a number: fill it in"),
        ("abc", "'abc' is not a number"),
        ("1_0", "'1_0' is not a number"),
        ("nan", "'nan' is not a number; every cell between the first and the last full row"),
        ("-inf", "-inf is not finite"),
        ("1e999", "1e999 is not finite"),
    ],
)
def test_a_cell_that_is_no_finite_number_is_refused(tmp_path, elbow, title, cell, problem):
    path = write(tmp_path, edited(33, title, cell))
    refused(path, elbow, f"row 33, column {title!r}: {problem}")


def test_time_that_goes_back_names_both_rows(tmp_path, elbow):
    path = write(tmp_path, edited(30, "time", "0.0035"))
    place = "row 30, column 'time': 0.0035 s comes after 0.027 s in row 29"
    refused(path, elbow, place, "time must ascend: sort the rows")


def test_time_that_repeats_names_both_rows(tmp_path, elbow):
    path = write(tmp_path, edited(30, "time", "0.027"))
    place = "row 30, column 'time': 0.027 s is the time of row 29 again"
    refused(path, elbow, place, "each row must have its own", "more decimals")


def test_unevenly_sampled_time_is_accepted(tmp_path, elbow):
    time = np.cumsum(np.random.default_rng(1).uniform(5e-4, 5e-3, 120)) - 0.1
    read = read_measurement(write(tmp_path, table(time=[repr(float(t)) for t in time])), elbow)
    np.testing.assert_array_equal(read.time, time)


@pytest.mark.parametrize(
    ("title", "cell", "problem"),
    [
        (
            "elbow_flexor",
            "35",
            "35 is no excitation; it must be in [0, 1], or outside by at most 5 % of its span: "
            "percent? write `elbow_flexor [%]`",
        ),
        ("elbow_flexor", "1.06", "1.06 is no excitation"),
        (
            "elbow_extensor",
            "-0.1",
            "-0.1 is no excitation; it must be in [0, 1], or outside by at most 5 % of its span: "
            "remove the offset",
        ),
    ],
)
def test_an_excitation_outside_its_bounds_is_refused(tmp_path, elbow, title, cell, problem):
    path = write(tmp_path, edited(50, title, cell))
    refused(path, elbow, f"row 50, column {title!r}: {problem}")


def test_a_percentage_above_a_hundred_is_refused_in_percent(tmp_path, elbow):
    header = ("time", "angle", "torque", "elbow_flexor [%]", "elbow_extensor")
    path = write(tmp_path, table(header, elbow_flexor=["100"] * 119 + ["120"]))
    place = "row 121, column 'elbow_flexor [%]': 120 % is no excitation"
    message = refused(path, elbow, place, "it must be in [0, 100 %]", "maximal effort")
    assert "percent?" not in message


def test_an_angle_past_a_full_turn_asks_for_degrees(tmp_path, elbow):
    cells = [repr(value) for value in np.linspace(3.0, 90.0, 120).tolist()]
    message = refused(write(tmp_path, table(angle=cells)), elbow, "row 7, column 'angle': ")
    assert "more than a full turn" in message
    assert "degrees? write `angle [deg]`" in message


def test_an_angle_that_the_joint_cannot_have_is_refused_with_its_range(tmp_path, elbow):
    refused(
        write(tmp_path, edited(15, "angle", "-1.2")),
        elbow,
        "row 15, column 'angle': -1.2 rad is impossible for the elbow",
        "within 1 rad of its range, 0 to 2.496 rad (0 to 143 deg)",
    )


@pytest.mark.parametrize(("cell", "problem"), [("300", "impossible"), ("-400", "full turn")])
def test_a_bad_angle_in_degrees_does_not_ask_for_degrees(tmp_path, elbow, cell, problem):
    header = ("time", "angle [deg]", *HEADER[2:])
    path = write(tmp_path, table(header, angle=[cell] * 120))
    message = refused(path, elbow, f"row 2, column 'angle [deg]': {cell} deg is", problem)
    assert "degrees?" not in message


@pytest.mark.parametrize("cell", ["0.0", "-0.99", "3.4"])
def test_an_angle_near_the_range_is_accepted(tmp_path, elbow, cell):
    assert float(cell) in read_measurement(write(tmp_path, edited(2, "angle", cell)), elbow).angle


def test_a_torque_beyond_the_muscles_is_refused(tmp_path, elbow):
    strongest = max(muscle.max_isometric_force for muscle in elbow.muscles.values())
    torque = f"{-10 * strongest - 1:.1f}"
    refused(
        write(tmp_path, edited(77, "torque", torque)),
        elbow,
        f"row 77, column 'torque': {torque} N·m is too much for the elbow; it must be within "
        f"±{10 * strongest:g} N·m",
        "write `torque [mN·m]`",
    )
    header = ("time", "angle", "torque [N·mm]", *HEADER[3:])
    path = write(tmp_path, table(header, torque=["700000"] * 120))
    message = refused(path, elbow, "row 2, column 'torque [N·mm]': 700000 N·mm is too much")
    assert "[mN·m]" not in message


def times(interval, samples=120):
    return [repr(value) for value in (np.arange(samples) * interval).tolist()]


def test_time_in_milliseconds_without_a_unit_is_refused(tmp_path, elbow):
    refused(
        write(tmp_path, table(time=times(1.0))),
        elbow,
        "rows 2 to 121, column 'time': the median interval is 1 s",
        "too coarse to see a muscle, or the time is in ms: write `time [ms]`",
    )


def test_coarse_time_that_is_in_milliseconds_says_to_measure_more_often(tmp_path, elbow):
    path = write(tmp_path, table(("time [ms]", *HEADER[1:]), time=times(200.0)))
    message = refused(path, elbow, "column 'time [ms]': the median interval is 0.2 s")
    assert "measure more often" in message
    assert "the time is in ms" not in message


def test_time_too_fine_is_refused(tmp_path, elbow):
    path = write(tmp_path, table(time=times(9e-6)))
    refused(path, elbow, "rows 2 to 121, column 'time': the median interval is 9e-06 s")
    path = write(tmp_path, table(("time [ms]", *HEADER[1:]), time=times(1e-3)))
    refused(path, elbow, "column 'time [ms]': the median", "write `time [s]`")


def test_time_at_the_finest_interval_and_the_least_duration_is_accepted(tmp_path, elbow):
    samples = 10_001  # 0.1 s
    read = read_measurement(
        write(tmp_path, table(samples=samples, time=times(1e-5, samples))), elbow
    )
    assert len(read) == samples
    samples = 51
    late = [f"{7.3 + 0.002 * k:.3f}" for k in range(samples)]  # 7.4 - 7.3 is less than 0.1
    assert len(read_measurement(write(tmp_path, table(samples=51, time=late)), elbow)) == samples


@pytest.mark.parametrize("samples", [1, 2, 49])
def test_too_few_samples_are_refused(tmp_path, elbow, samples):
    path = write(tmp_path, table(samples=samples))
    place = f"rows 2 to {samples + 1}, column 'time': {samples} samples are too few to fit"
    refused(path, elbow, place, "50 or more")


def test_too_short_a_time_is_refused(tmp_path, elbow):
    path = write(tmp_path, table(samples=99))
    refused(
        path, elbow, "rows 2 to 100, column 'time': 0.098 s are too few to fit", "0.1 s or more"
    )


def test_a_file_in_which_nothing_happens_is_refused(tmp_path, elbow):
    still = {name: ["0.5"] * 120 for name in HEADER[1:]}
    still["angle"] = ["0.5", "0.5000005"] * 60
    refused(
        write(tmp_path, table(**still)),
        elbow,
        "rows 2 to 121, column 'angle': nothing to learn from",
        "'torque', 'elbow_flexor', 'elbow_extensor' never change",
    )


@pytest.mark.parametrize("moving", ["angle", "torque", "elbow_flexor"])
def test_one_thing_that_changes_is_enough(tmp_path, elbow, moving):
    still = {name: ["0.5"] * 120 for name in HEADER[1:] if name != moving}
    assert len(read_measurement(write(tmp_path, table(**still)), elbow)) == 120


def test_series_of_a_measurement_must_fit_its_time():
    with pytest.raises(ValueError, match=r"here: angle must have the shape of time, \(3,\)"):
        Measurement("here", np.zeros(3), {}, np.zeros(2), np.zeros(3))
    with pytest.raises(ValueError, match="here: elbow_flexor must have the shape of time"):
        Measurement("here", np.zeros(3), {"elbow_flexor": np.zeros(2)}, np.zeros(3), np.zeros(3))
