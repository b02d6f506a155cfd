import warnings

import pytest

from mjhill.cli.warned import one_line_warnings


def test_a_warning_of_a_command_is_one_printable_line(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with one_line_warnings():
            warnings.warn("muscle 'm' did\nwhat\x1b[2J no muscle can", RuntimeWarning, stacklevel=1)
    printed = capsys.readouterr()
    assert printed.err == "warning: muscle 'm' did what\\x1b[2J no muscle can\n"
    assert printed.out == ""


def test_warnings_are_shown_as_before_afterwards():
    before = warnings.showwarning
    with one_line_warnings():
        assert warnings.showwarning is not before
    assert warnings.showwarning is before


def test_warnings_that_are_errors_stay_errors():
    with one_line_warnings(), pytest.raises(RuntimeWarning, match="as asked"):
        warnings.warn("as asked", RuntimeWarning, stacklevel=1)  # errors, as in all tests
