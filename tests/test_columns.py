"""Files as the devices and programs of laboratories write them, all of the same movement."""

import re

import numpy as np
import pytest

from mjhill.identification.measurement import read_measurement
from mjhill.identification.units import factor_to_si

SAMPLES = 150
TIME = np.arange(SAMPLES) * 2e-3
ANGLE = np.round(60 + 20 * np.sin(10 * TIME), 3)  # [deg]
TORQUE = np.round(3 * np.cos(10 * TIME), 3)  # [N·m]
FLEXOR = np.where(TIME > 0.05, 0.4, 0.0)
EXTENSOR = np.round(0.1 * np.sin(5 * TIME) ** 2, 3)


def saved(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "trial.csv"
    path.write_bytes(text.encode(encoding))
    return path


def rows(*columns, delimiter=",", after="", decimal=".", digits=6):
    """Lines of numbers."""
    lines = []
    for numbers in zip(*columns, strict=True):
        cells = [n if isinstance(n, str) else f"{n:.{digits}f}" for n in numbers]
        lines.append(delimiter.join(cells).replace(".", decimal) + after)
    return "\n".join(lines) + "\n"


def plain(header="time [s],angle [deg],torque [N·m],elbow_flexor,elbow_extensor", **options):
    return f"{header}\n" + rows(TIME, ANGLE, TORQUE, FLEXOR, EXTENSOR, **options)


def check(measurement, first=0, end=SAMPLES):
    """It holds the movement, or some of its samples."""
    pick = slice(first, end)
    np.testing.assert_allclose(measurement.time, TIME[pick], atol=1e-9)
    np.testing.assert_allclose(measurement.angle, np.radians(ANGLE[pick]), atol=1e-8)
    np.testing.assert_allclose(measurement.torque, TORQUE[pick], atol=1e-5)
    np.testing.assert_allclose(measurement.excitation["elbow_flexor"], FLEXOR[pick], atol=1e-7)
    np.testing.assert_allclose(measurement.excitation["elbow_extensor"], EXTENSOR[pick], atol=1e-7)


def refused(path, elbow, *parts, **options):
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_measurement(path, elbow, **options)
    for part in parts:
        assert part in str(caught.value)


# --- exports


def test_a_dynamometer_with_a_row_of_units_and_trailing_commas(tmp_path, elbow):
    """In the style of Biodex: name and unit of the time are one, units stand below the titles."""
    text = (
        "Biodex System 4,,,,,,,\n"
        "Patient:,0017,,,,,,\n"
        "Protocol:,Isotonic Unilateral,,,,,,\n"
        "\n"
        "mSec,TORQUE,POSITION,POS (ANAT),VELOCITY,FLEXOR EMG,EXTENSOR EMG,\n"
        ",FT-LBS,DEGREES,DEGREES,DEG/SEC,%,%,\n"
    ) + rows(
        1e3 * TIME, TORQUE / 1.3558179483314004, ANGLE, -ANGLE, 0 * TIME, 100 * FLEXOR,
        100 * EXTENSOR, after=",",
    )  # fmt: skip
    measurement = read_measurement(saved(tmp_path, text.replace("\n", "\r\n")), elbow)
    check(measurement)
    assert measurement.notes == ()


def test_emg_that_dips_below_zero_and_ends_before_the_other_columns(tmp_path, elbow):
    """In the style of Delsys: a preamble of keys and values, and sensors that end early."""
    emg = FLEXOR.copy()
    emg[[3, 9]] = -0.01
    cells = [f"{u:.4f}" for u in emg]
    cells[-4:] = ["", "", "NaN", ""]
    text = (
        "Application:,Trigno Discover\nDate/Time:,11/26/2026 09:12:44 AM\n"
        "Collection Length (seconds):,0.3\n\n"
        'Time (s),Elbow Angle (deg),"Torque (N·m)",EMG elbow_flexor (-),elbow_extensor EMG,,\n'
    ) + rows(TIME, ANGLE, TORQUE, cells, EXTENSOR, after=",,")
    measurement = read_measurement(saved(tmp_path, text), elbow)
    check(measurement, end=SAMPLES - 4)
    assert measurement.notes == (
        "rows 152 to 155 at the end left out: not all cells hold numbers",
        "'EMG elbow_flexor (-)': 2 samples below 0 clipped, at most -0.0100",
    )


def test_a_text_file_whose_preamble_has_a_time_and_whose_rows_lack_the_last_cell(tmp_path, elbow):
    """In the style of LabVIEW: tabs, two headers, a column of comments that stays empty."""
    text = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        "Date\t2026/11/26\nTime\t09:12:44.123\n***End_of_Header***\t\n\t\n"
        "Channels\t4\nSamples\t150\t150\t150\t150\nTime\t09:12:44\t09:12:44\t09:12:44\t09:12:44\n"
        "***End_of_Header***\t\t\t\n"
        "X_Value\tAngle/deg\tTorque_Nmm\tFlexor [%MVC]\tExtensor [%MVC]\tComment\n"
    ) + rows(TIME, ANGLE, 1e3 * TORQUE, 100 * FLEXOR, 100 * EXTENSOR, delimiter="\t")
    check(read_measurement(saved(tmp_path, text), elbow))


def test_quoted_cells_a_row_of_units_in_brackets_and_a_blank_line_under_it(tmp_path, elbow):
    """In the style of Vicon Nexus: names of the section above the titles."""
    text = (
        '"Devices"\n500\n,,"Subject:Elbow"\n'
        '"Frame","t","Joint Angle","External Torque","elbow_flexor","elbow_extensor"\n'
        '"","(ms)","(mrad)","(kN*m)","[1]",""\n\n'
    ) + rows(
        np.arange(SAMPLES).astype(str).tolist(), 1e3 * TIME, 1e3 * np.radians(ANGLE),
        1e-3 * TORQUE, FLEXOR, EXTENSOR, digits=9,
    )  # fmt: skip
    measurement = read_measurement(saved(tmp_path, text), elbow)
    check(measurement)
    assert measurement.notes == ()


def test_a_spreadsheet_with_decimal_commas_in_another_encoding(tmp_path, elbow):
    """In the style of a German Excel: semicolons, commas, Windows-1252, CRLF."""
    header = "Time (s);Angle (°);Torque (N·m);elbow_flexor;elbow_extensor;;"
    text = "sep=;\n" + plain(header, delimiter=";", decimal=",", after=";;")
    measurement = read_measurement(saved(tmp_path, text.replace("\n", "\r\n"), "cp1252"), elbow)
    check(measurement)
    assert measurement.notes == (
        "read as Windows-1252, as it is not UTF-8",
        "read with a decimal comma",
    )


def test_the_unicode_text_of_a_spreadsheet(tmp_path, elbow):
    text = plain("Time [s]\tAngle [deg]\tTorque [Nm]\tflexor\textensor", delimiter="\t")
    check(read_measurement(saved(tmp_path, text, "utf-16"), elbow))


def test_a_header_that_numpy_wrote_as_a_comment(tmp_path, elbow):
    path = tmp_path / "trial.csv"
    columns = np.column_stack([TIME, ANGLE, TORQUE, FLEXOR, EXTENSOR])
    header = "by hand\ntime [s],angle [deg],torque [N*m],elbow_flexor,elbow_extensor"
    np.savetxt(path, columns, delimiter=",", header=header)
    check(read_measurement(path, elbow))


# --- titles and units


@pytest.mark.parametrize(
    "header",
    [
        "Time,Angle_deg,Torque (Nm),Elbow Flexor,Elbow Extensor",
        "t [s],angle/deg,TORQUE_Nm,ELBOW_FLEXOR,ELBOW_EXTENSOR",
        "time in s,Elbow.Angle [°],Elbow torque [N m],elbow_flexor.u [-],elbow_extensor.u",
        "seconds,joint angle (degrees),applied torque / N·m,flexor emg,extensor excitation",
        "  TIME (SEC) ,Position deg,elbow.applied[ NM ],flexor,extensor []",
    ],
)
def test_titles_are_read_in_the_forms_that_people_write(tmp_path, elbow, header):
    check(read_measurement(saved(tmp_path, plain(header)), elbow))


@pytest.mark.parametrize(
    "others",
    ["angle_raw,torque limit,elbow_flexor_1", "Angle Velocity,time stamp,elbow_flexor_mV"],
)
def test_titles_that_only_begin_like_a_wanted_one_are_other_columns(tmp_path, elbow, others):
    header = f"time,angle [deg],torque,elbow_flexor,elbow_extensor,{others}"
    check(read_measurement(saved(tmp_path, plain(header, after=",7,8,9")), elbow))


@pytest.mark.parametrize(
    ("unit", "quantity", "factor"),
    [
        ("milliseconds", "time", 1e-3),
        ("mSec", "time", 1e-3),
        ("degree", "angle", np.pi / 180),
        ("DEG", "angle", np.pi / 180),
        ("mrad", "angle", 1e-3),
        ("N*mm", "torque", 1e-3),
        ("Ncm", "torque", 1e-2),
        ("nm", "torque", 1.0),  # no torque is in nanometres
        ("mN·m", "torque", 1e-3),
        ("MN·m", "torque", 1e6),
        ("Newton-meters", "torque", 1.0),
        ("lbf*ft", "torque", 4.4482216152605 * 0.3048),
        ("in-lbs", "torque", 4.4482216152605 * 0.0254),
        ("kgf.m", "torque", 9.80665),
        ("% MVC", "excitation", 0.01),
        ("percent", "excitation", 0.01),
        ("", "angle", 1.0),
    ],
)
def test_units_are_those_of_the_quantity(unit, quantity, factor):
    assert factor_to_si(unit, quantity) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("unit", "quantity"),
    [
        ("m", "time"), ("%", "angle"), ("1", "angle"), ("kg*m", "torque"), ("N", "torque"),
        ("V", "excitation"), ("rad", "excitation"), ("(", "torque"), ("s" * 99, "time"),
    ],
)  # fmt: skip
def test_a_unit_of_something_else_is_refused(unit, quantity):
    with pytest.raises(ValueError, match=re.escape(f"unknown unit {unit!r} of {quantity}")):
        factor_to_si(unit, quantity)


def test_a_unit_that_means_two_things_is_refused(tmp_path, elbow):
    header = "time,angle [Grad],torque,elbow_flexor,elbow_extensor"
    place = "row 1, column 'angle [Grad]': 'Grad' is degrees to some and gon to others"
    refused(saved(tmp_path, plain(header)), elbow, place, "write deg or gon")


def test_a_wrong_unit_under_a_title_names_its_row(tmp_path, elbow):
    header = "time,angle,torque,elbow_flexor,elbow_extensor\ns,deg,N,-,-"
    place = "row 2, column 'torque': unknown unit 'N' of torque"
    refused(saved(tmp_path, plain(header)), elbow, place)
    header = "time,angle [deg],torque,elbow_flexor,elbow_extensor\ns,rad,Nm,-,-"
    place = "row 2, column 'angle [deg]': 'deg' in the title, 'rad' under it"
    refused(saved(tmp_path, plain(header)), elbow, place)
    text = "time,angle,torque,elbow_flexor,elbow_extensor\ns,rad,Nm,-,-\n"
    refused(saved(tmp_path, text), elbow, "row 2: no rows follow the units")


def test_a_missing_unit_of_an_angle_or_torque_is_told(tmp_path, elbow):
    text = "time,angle,torque,elbow_flexor,elbow_extensor\n"
    text += rows(TIME, np.radians(ANGLE), TORQUE, FLEXOR, EXTENSOR, digits=9)
    measurement = read_measurement(saved(tmp_path, text), elbow)
    check(measurement)
    assert measurement.notes == (
        "'angle' has no unit: taken as rad",
        "'torque' has no unit: taken as N·m",
    )


# --- numbers


COMMAS = "time [s];angle [deg];torque [N·m];elbow_flexor;elbow_extensor"


def test_the_decimal_sign_is_found_or_given(tmp_path, elbow):
    path = saved(tmp_path, plain(COMMAS, delimiter=";", decimal=","))
    check(read_measurement(path, elbow))
    check(read_measurement(path, elbow, decimal=","))
    place = "row 2, column 'time [s]': '0,000000' has a decimal comma, but numbers here have"
    refused(path, elbow, place, "write 0.000000", decimal=".")
    refused(path, elbow, "decimal must be . or ,, got ';'", decimal=";")


def test_a_decimal_point_among_commas_is_refused(tmp_path, elbow):
    text = plain(COMMAS, delimiter=";", decimal=",").replace("60,000000", "60.0", 1)
    place = "row 2, column 'angle [deg]': '60.0' has a decimal point, but numbers here have"
    refused(saved(tmp_path, text), elbow, place, decimal=",")
    refused(saved(tmp_path, text), elbow, "row 2, column 'time [s]': '0,000000' has a decimal")


def test_commas_that_may_be_between_thousands_are_refused(tmp_path, elbow):
    text = "time [ms];angle [deg];torque [N·m];elbow_flexor;elbow_extensor\n"
    whole = [f"{ms:,}" for ms in range(1000, 1150)]
    text += rows(whole, [str(round(a)) for a in ANGLE], ["0"] * 150, ["0"] * 150, ["1"] * 150,
                 delimiter=";")  # fmt: skip
    path = saved(tmp_path, text)
    refused(path, elbow, "'1,000' may have a decimal comma or one between thousands", "--decimal")
    refused(path, elbow, "row 2, column 'time [ms]': '1,000' has a decimal comma", decimal=".")


def test_unquoted_decimal_commas_between_commas_say_what_to_do(tmp_path, elbow):
    place = "row 2, column 'elbow_extensor': the row has 10 cells"
    path = saved(tmp_path, plain(decimal=","))
    refused(path, elbow, place, "separate the cells by semicolons", decimal=",")


def test_rows_without_numbers_are_left_out_at_the_ends_only(tmp_path, elbow):
    lines = plain().splitlines()
    lines[1] = "0,,,,"
    lines[2] = "0.002,NaN,1,0,0"
    lines[-1] = "n/a,60,1,0,0"
    path = saved(tmp_path, "\n".join(lines))
    measurement = read_measurement(path, elbow)
    check(measurement, 2, SAMPLES - 1)
    assert measurement.notes == (
        "rows 2 to 3 at the start left out: not all cells hold numbers",
        "row 151 at the end left out: not all cells hold numbers",
    )
    lines[50] = "0.098,,1,0,0"
    path = saved(tmp_path, "\n".join(lines))
    refused(path, elbow, "row 51, column 'angle [deg]': the cell is empty")


def test_a_column_that_holds_no_numbers_is_refused(tmp_path, elbow):
    text = plain().splitlines()
    lines = [text[0], *(line.rpartition(",")[0] + ",NaN" for line in text[1:])]
    place = "rows 2 to 151, column 'elbow_extensor': 150 of 150 cells hold no number"
    refused(saved(tmp_path, "\n".join(lines)), elbow, place)
    half = [*text[:70], *lines[70:]]
    place = "rows 2 to 151, column 'elbow_extensor': 81 of 150 cells hold no number"
    refused(saved(tmp_path, "\n".join(half)), elbow, place)


def test_an_excitation_slightly_above_a_maximal_effort_is_clipped_and_told(tmp_path, elbow):
    cells = [f"{u:.2f}" for u in np.where(TIME > 0.1, 103.5, 0)]
    text = "time,angle [deg],torque [Nm],elbow_flexor [%],elbow_extensor\n"
    text += rows(TIME, ANGLE, TORQUE, cells, EXTENSOR)
    measurement = read_measurement(saved(tmp_path, text), elbow)
    assert measurement.excitation["elbow_flexor"].max() == 1.0
    assert measurement.notes == (
        "'elbow_flexor [%]': 99 samples above 1 clipped, at most 103.50 %",
    )


# --- torque


WITHOUT = "time [s],angle [deg],elbow_flexor,elbow_extensor"


def test_a_constant_torque_stands_for_its_column(tmp_path, elbow):
    path = saved(tmp_path, f"{WITHOUT}\n" + rows(TIME, ANGLE, FLEXOR, EXTENSOR))
    refused(path, elbow, "a column torque is missing", "or --torque 0")
    measurement = read_measurement(path, elbow, torque=-1.5)
    np.testing.assert_array_equal(measurement.torque, np.full(SAMPLES, -1.5))
    assert measurement.notes == ("torque: -1.5 N·m, as given",)
    refused(path, elbow, "torque must be within", "got 10000", torque=1e4)
    refused(path, elbow, "torque must be within", "got nan", torque=float("nan"))


def test_a_constant_torque_beside_a_column_of_torques_is_refused(tmp_path, elbow):
    place = "row 1, column 'torque [N·m]': the file has torques, and a constant torque is given too"
    refused(saved(tmp_path, plain()), elbow, place, torque=0.0)


def test_a_measurement_knows_the_hash_of_its_file(tmp_path, elbow):
    import hashlib

    path = saved(tmp_path, plain())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert read_measurement(path, elbow).digest == digest
